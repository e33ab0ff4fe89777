"""The world that a herd steps: a robot in a scene with the sensors that are read."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from humanoid_getup.simulation.scene import Scene
from humanoid_getup.simulation.world import add_touch
from robots import Robot
from sim2real.environment.model_variants import Change

LONGEST_DELAY = 0.064  # s that the history buffers hold


def build_world(
    robot: Robot,
    scene: Scene,
    timestep: float,
    longest_delay: float = 0.0,
    changes: Sequence[Change] = (),
) -> mujoco.MjModel:
    """Compile a robot in a scene with the sensors that a herd reads.

    Args:
        robot: Robot.
        scene: Where it lies.
        timestep: Physics step [s]; a control period must be a multiple of it.
        longest_delay: Longest delay of targets and measurements that histories hold [s].
        changes: What else differs from the robot's description.
    """
    spec = scene.build(robot)
    spec.option.timestep = timestep
    for change in changes:
        change(spec, robot)
    timestep = spec.option.timestep
    samples = int(np.ceil(longest_delay / timestep - 1e-9))
    sensor, obj = mujoco.mjtSensor, mujoco.mjtObj
    for name in robot.joint_names:
        for kind, label in ((sensor.mjSENS_JOINTPOS, "pos"), (sensor.mjSENS_JOINTVEL, "vel")):
            spec.add_sensor(
                name=f"{label}_{name}", type=kind, objtype=obj.mjOBJ_JOINT, objname=name
            )
    imu = {"objtype": obj.mjOBJ_SITE, "objname": robot.imu_site}
    spec.add_sensor(name="imu_gyro", type=sensor.mjSENS_GYRO, **imu)
    spec.add_sensor(name="imu_orientation", type=sensor.mjSENS_FRAMEQUAT, **imu)
    for element in spec.sensors:
        element.nsample = samples
    for element in spec.actuators:
        element.nsample = samples
    add_touch(spec, "whole", robot.torso, subtree=True)
    for site in robot.sole_sites:
        add_touch(spec, f"foot_{site}", spec.site(site).parent.name, subtree=False)
    for name in _list_head_joints(robot)[-1:]:
        head = spec.joint(name).parent.name
        add_touch(spec, "head_touch", head, subtree=True)
        spec.add_sensor(
            name="head_velocity",
            type=sensor.mjSENS_FRAMELINVEL,
            objtype=obj.mjOBJ_BODY,
            objname=head,
        )
    return spec.compile()


def _list_head_joints(robot: Robot) -> list[str]:
    return [joint.name for joint in robot.joints if joint.segment == "head"]


class Addresses:
    """Where a world's sensors are."""

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        def at(name: str) -> int:
            return int(model.sensor(name).adr[0])

        self.joint_pos = np.array([at(f"pos_{name}") for name in robot.joint_names])
        self.joint_vel = np.array([at(f"vel_{name}") for name in robot.joint_names])
        self.gyro = at("imu_gyro") + np.arange(3)
        self.orientation = at("imu_orientation") + np.arange(4)
        self.whole = at("whole")
        self.feet = [at(f"foot_{site}") for site in robot.sole_sites]
        self.imu_in_torso = np.array(model.site(robot.imu_site).quat)
        has_head = bool(_list_head_joints(robot))
        self.head_touch = at("head_touch") + np.arange(1) if has_head else np.arange(0)
        self.head_velocity = at("head_velocity") + np.arange(3) if has_head else np.arange(0)
        self.is_delayed = model.sensor_history[:, 0] > 0
