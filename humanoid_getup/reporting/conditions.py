"""The conditions of a benchmark, with which its figures must be cited."""

from __future__ import annotations

import platform
from collections import Counter
from importlib.metadata import version
from typing import Any

import mujoco

from humanoid_getup.simulation.world import World
from robots import TorqueLimit


def describe_conditions(world: World, limit: TorqueLimit) -> dict[str, Any]:
    """Describe robot, servos, limit and programs under the keys of benchmark.json."""
    robot = world.robot
    torso = robot.layout(world.model).torso
    servos = Counter(joint.servo.model.name for joint in robot.joints)
    return {
        "body": str(robot.body),
        "mass_kg": float(world.model.body_subtreemass[torso]),
        "neck_height_m": robot.standing_neck_height,
        "joints": robot.n,
        "servos": dict(servos.most_common()),
        "stall_torque_nm": float(robot.max_torque.max()),
        "supply_v": robot.supply_voltage,
        "limit_by": limit.mode,
        "control_period_s": robot.control_period,
        "scene": world.scene.name,
        "humanoid_getup": version("humanoid-getup"),
        "mujoco": mujoco.__version__,
        "python": platform.python_version(),
    }
