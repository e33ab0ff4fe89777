"""Model of the stage: a world with a second, translucent robot that touches nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco

if TYPE_CHECKING:
    from humanoid_getup.simulation.world import World

GHOST = "ghost/"
"""Prefix of the ghost's names."""
HIDDEN = 5  # group of geoms that are not seen
GRAVITY = 9.81  # m/s²
ARROW = 1.2  # standing neck heights, of a force as large as the robot's weight


def build_model(world: World) -> mujoco.MjModel:
    """Compile the world of a robot with its ghost.

    The positions of the ghost follow those of the robot, in the same order: (2 * nq,).
    """
    spec = world.scene.build(world.robot)
    _remove_sensors(spec)
    frame = spec.worldbody.add_frame()
    frame.attach_body(_make_ghost(world).body(world.robot.torso), GHOST, "")
    model = spec.compile()
    expected = [*_list_joints(world.model), *(GHOST + name for name in _list_joints(world.model))]
    if _list_joints(model) != expected:
        raise RuntimeError(f"joints of the stage are {_list_joints(model)}, expected {expected}")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    weight = world.model.body_subtreemass[world.robot.layout(world.model).torso] * GRAVITY
    length = ARROW * world.robot.standing_neck_height  # MuJoCo divides by the mean mass of a body
    model.vis.map.force = length / weight * model.stat.meanmass
    return model


def _make_ghost(world: World) -> mujoco.MjSpec:
    ghost = world.robot.read_model()
    _remove_sensors(ghost)
    for element in [*ghost.actuators, *ghost.equalities, *ghost.tendons, *ghost.sites]:
        ghost.delete(element)
    for element in [*ghost.pairs, *ghost.excludes, *ghost.lights, *ghost.cameras]:
        ghost.delete(element)
    for geom in ghost.geoms:
        geom.contype = geom.conaffinity = 0
        if geom.rgba[3] == 0.0:
            geom.group = HIDDEN
        geom.material, geom.rgba = "", (0.0, 0.0, 0.0, 0.0)  # `Ghost` draws it
    return ghost


def _remove_sensors(spec: mujoco.MjSpec) -> None:
    for sensor in spec.sensors:
        spec.delete(sensor)


def _list_joints(model: mujoco.MjModel) -> list[str]:
    return [model.joint(number).name for number in range(model.njnt)]
