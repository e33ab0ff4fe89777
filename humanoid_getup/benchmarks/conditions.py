"""The conditions of a benchmark, with which its figures must be cited."""

from __future__ import annotations

import platform
from collections import Counter
from importlib.metadata import version

import msgspec
import mujoco

from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.servo import LimitMode


class Conditions(msgspec.Struct, frozen=True, kw_only=True):
    """Robot, servos, limit and programs of a benchmark."""

    body: str
    mass_kg: float
    neck_height_m: float
    joints: int
    servos: dict[str, int]
    stall_torque_nm: float
    supply_v: float
    limit_by: LimitMode
    control_period_s: float
    scene: str
    humanoid_getup: str
    mujoco: str
    python: str


def describe_conditions(world: World, limit: TorqueLimit) -> Conditions:
    """Describe robot, servos, limit and programs."""
    robot = world.robot
    torso = robot.layout(world.model).torso
    servos = Counter(joint.servo.model.name for joint in robot.joints)
    return Conditions(
        body=str(robot.body),
        mass_kg=float(world.model.body_subtreemass[torso]),
        neck_height_m=robot.standing_neck_height,
        joints=robot.n,
        servos=dict(servos.most_common()),
        stall_torque_nm=float(robot.max_torque.max()),
        supply_v=robot.supply_voltage,
        limit_by=limit.mode,
        control_period_s=robot.control_period,
        scene=world.scene.name,
        humanoid_getup=version("humanoid-getup"),
        mujoco=mujoco.__version__,
        python=platform.python_version(),
    )
