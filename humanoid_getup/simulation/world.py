"""The world: a robot compiled into a scene, with the contact sensors that rollouts read."""

from __future__ import annotations

import copy
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import Scene
from robots import Robot
from robots.arguments import expect
from robots.ground import GROUND
from robots.quaternion import Array

SEARCH_TIMESTEP = 0.004  # s; what a search finds is judged and recorded in the world's own steps
ROBOT_CONTACT = "whole"
"""Name of the sensor that counts the contacts of the whole robot with the world."""


class World:
    """A robot compiled into a scene, with the contact sensors that rollouts read.

    Planning, rollouts and the twin work in one world, and leave it as it is.
    """

    def __init__(
        self,
        robot: Robot,
        scene: Scene | str | Path = "flat",
        *,
        model: mujoco.MjModel | None = None,
    ) -> None:
        """Compile a robot in a scene, unless ``model`` is given, with other sensors or options.

        Raises:
            ValueError: if there is no scene of that name, or an argument is of another type.
        """
        expect("robot", robot, Robot, "a Robot, e.g. load_robot('op3')")
        expect("scene", scene, Scene | str | Path, "a name, a .toml file or a Scene")
        self.robot = robot
        self.scene = scene if isinstance(scene, Scene) else load_scene(str(scene), robot)
        self.model = model = _compile(robot, self.scene) if model is None else model
        self.is_world_geom = model.body_weldid[model.geom_bodyid] == 0
        """Whether each geom belongs to the scene, (ngeom,)."""
        roots = np.flatnonzero(model.body_parentid == model.body(robot.torso).id)
        self.limbs = tuple(model.body(int(body)).name for body in roots)
        """Bodies at the root of each limb."""

    def __repr__(self) -> str:
        return f"World({self.robot.name} in scene {self.scene.name})"

    def vary(
        self,
        *,
        ground_friction: float | None = None,
        timestep: float | None = None,
        dry_friction: bool = True,
    ) -> World:
        """Return this world with another sliding friction of the ground, or physics step [s].

        ``dry_friction`` is that of the joints, each of which is a constraint in every step.
        """
        model = copy.copy(self.model)
        if not dry_friction:
            model.dof_frictionloss[:] = model.tendon_frictionloss[:] = 0.0
        if ground_friction is not None:
            model.geom_friction[model.geom(GROUND).id, 0] = ground_friction
        if timestep is not None:
            model.opt.timestep = timestep
        return World(self.robot, self.scene, model=model)

    @property
    def content(self) -> bytes:
        """Return the compiled model and the robot's description, which identify a world."""
        model = np.empty(mujoco.mj_sizeModel(self.model), np.uint8)
        mujoco.mj_saveModel(self.model, None, model)
        limp = " ".join(self.robot.limp_joints).encode()
        own = self.robot.individual
        differs = b"" if own.is_as_described else repr(own).encode()
        return model.tobytes() + (self.robot.folder / "robot.toml").read_bytes() + limp + differs

    def find_non_foot_contact(self, sensordata: Array) -> NDArray[np.bool_]:
        """Find contacts of more than the feet with the world, (..., nsensordata) to (...)."""
        robot_address, *feet = self._contact_addresses
        return sensordata[..., robot_address] > sensordata[..., feet].sum(axis=-1)

    @cached_property
    def _contact_addresses(self) -> list[int]:
        names = [ROBOT_CONTACT, *(f"foot_{site}" for site in self.robot.sole_sites)]
        return [int(self.model.sensor(name).adr[0]) for name in names]


def _compile(robot: Robot, scene: Scene) -> mujoco.MjModel:
    spec = scene.build(robot)
    for limb in spec.body(robot.torso).bodies:
        add_contact_sensor(spec, f"limb_{limb.name}", limb.name, subtree=True, force=True)
    add_stance_sensors(spec, robot)
    _add_overlap(spec, robot.torso)
    return spec.compile()


def add_stance_sensors(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Add sensors of the contacts of the robot, and of each foot, with the world."""
    add_contact_sensor(spec, ROBOT_CONTACT, robot.torso, subtree=True)
    for site in robot.sole_sites:
        add_contact_sensor(spec, f"foot_{site}", spec.site(site).parent.name, subtree=False)


def add_contact_sensor(
    spec: mujoco.MjSpec, name: str, body: str, *, subtree: bool, force: bool = False
) -> None:
    """Add a sensor of the contacts between a body (or its subtree) and the world.

    With ``force`` the number is followed by the point at which the net contact force acts.
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


def _add_overlap(spec: mujoco.MjSpec, torso: str) -> None:
    """Add a sensor of the deepest contact of the robot with itself."""
    distance, nearest = 1 << 3, 1  # mjCONDATA_DIST, reduction by smallest distance
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


def find_touching_bodies(world: World, qpos: Array) -> tuple[str, ...]:
    """Find the bodies besides the feet that touch the world at MuJoCo positions (nq,)."""
    model, data = world.model, mujoco.MjData(world.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    feet = {int(model.site(site).bodyid[0]) for site in world.robot.sole_sites}
    is_world = world.is_world_geom[data.contact.geom]
    geoms = data.contact.geom[is_world.any(axis=1)][~is_world[is_world.any(axis=1)]]
    bodies = np.unique(model.geom_bodyid[geoms])
    return tuple(model.body(body).name for body in bodies if int(body) not in feet)
