"""The world: a robot compiled into a scene, with the sensors that rehearsals read."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.scene import Scene
from robots import Robot
from robots.quaternion import Array


@dataclass(frozen=True)
class World:
    """A compiled scene with the robot and the touch sensors that rehearsals read."""

    robot: Robot
    scene: Scene
    model: mujoco.MjModel
    limbs: tuple[str, ...]
    """Bodies at the root of each limb."""

    @staticmethod
    def build(robot: Robot, scene: Scene) -> World:
        """Compile a robot in a scene with the sensors added."""
        spec = scene.build(robot)
        torso = spec.body(robot.torso)
        limbs = tuple(body.name for body in torso.bodies)
        for limb in limbs:
            add_touch(spec, f"limb_{limb}", limb, subtree=True, force=True)
        add_touch(spec, "whole", robot.torso, subtree=True)
        for site in robot.sole_sites:
            add_touch(spec, f"foot_{site}", spec.site(site).parent.name, subtree=False)
        _add_overlap(spec, robot.torso)
        return World(robot, scene, spec.compile(), limbs)


def add_touch(
    spec: mujoco.MjSpec, name: str, body: str, *, subtree: bool, force: bool = False
) -> None:
    """Sense contacts between a body (or its subtree) and the world.

    Args:
        spec: World that gets the sensor.
        name: Of the sensor.
        body: Body that touches.
        subtree: Whether all that hangs on it counts too.
        force: Whether to sense where the contact force acts besides the number of contacts.
    """
    found, point = 1 << 0, 1 << 4  # mjCONDATA_FOUND, mjCONDATA_POS
    net_force = 3
    spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY if subtree else mujoco.mjtObj.mjOBJ_BODY,
        objname=body,
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname="world",
        intprm=[found | point if force else found, net_force if force else 0, 1],
    )


def find_foreign(touch: Array, whole: int, feet: list[int]) -> NDArray[np.bool_]:
    """Tell whether anything but the feet touches the world, (...).

    Args:
        touch: Sensor data, (..., nsensordata).
        whole: Where the number of the whole robot's contacts is in it.
        feet: Where those of its feet are.
    """
    return touch[..., whole] > touch[..., feet].sum(axis=-1)


def _add_overlap(spec: mujoco.MjSpec, torso: str) -> None:
    """Sense the deepest contact of the robot with itself."""
    distance, nearest = 1 << 3, 1  # mjCONDATA_DIST, reduction by least distance
    spec.add_sensor(
        name="overlap",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY,
        objname=torso,
        reftype=mujoco.mjtObj.mjOBJ_XBODY,
        refname=torso,
        intprm=[distance, nearest, 1],
    )


def count_substeps(model: mujoco.MjModel, duration: float) -> int:
    """Count the physics steps of a control period, or of a policy step [s].

    Raises:
        ValueError: if the duration is no multiple of the physics step.
    """
    steps = round(duration / model.opt.timestep)
    if steps < 1 or abs(steps * model.opt.timestep - duration) > 1e-9:
        raise ValueError(
            f"a control period or policy step of {duration:g} s is no multiple of the physics "
            f"step {model.opt.timestep:g} s"
        )
    return steps
