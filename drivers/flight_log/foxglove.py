"""Foxglove's messages of a cycle: joints by name and the torso's orientation, in wall time.

Foxglove, and what knows its schemas, shows these without a layout. Their values are those of
the measurement and of the command that was sent, in the form of
https://docs.foxglove.dev/docs/sdk/schemas as JSON.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from drivers.control_loop import Cycle
from drivers.state import Command, State
from robots import Robot, quaternion
from robots.kinematics import imu_in_torso
from robots.quaternion import Array

JOINT_STATES, JOINT_COMMANDS, TRANSFORM = "/joint_states", "/joint_commands", "/tf"
WORLD = "world"
"""Frame of a transform: z points up, its yaw is that of the IMU."""
SECOND = 1_000_000_000  # ns

Json = dict[str, Any]


def _object(title: str, properties: Json, required: tuple[str, ...] = ()) -> Json:
    needed = required or tuple(properties)
    return {"type": "object", "title": title, "properties": properties, "required": needed}


def _numbers(*names: str) -> Json:
    return {name: {"type": "number"} for name in names}


TEXT, COUNT = {"type": "string"}, {"type": "integer", "minimum": 0}
TIME = _object("time", {"sec": COUNT, "nsec": COUNT | {"maximum": SECOND - 1}})
VECTOR = _object("foxglove.Vector3", _numbers("x", "y", "z"))
QUATERNION = _object("foxglove.Quaternion", _numbers("x", "y", "z", "w"))
JOINT = _object(
    "foxglove.JointState",
    {"name": TEXT} | _numbers("position", "velocity", "acceleration", "effort"),
    required=("name",),
)
JOINTS_SCHEMA = _object(
    "foxglove.JointStates", {"timestamp": TIME, "joints": {"type": "array", "items": JOINT}}
)
TRANSFORM_SCHEMA = _object(
    "foxglove.FrameTransform",
    {
        "timestamp": TIME,
        "parent_frame_id": TEXT,
        "child_frame_id": TEXT,
        "translation": VECTOR,
        "rotation": QUATERNION,
    },
)
SCHEMAS = {JOINT_STATES: JOINTS_SCHEMA, JOINT_COMMANDS: JOINTS_SCHEMA, TRANSFORM: TRANSFORM_SCHEMA}
"""Schemas of the topics; Foxglove knows them by their titles."""


class FoxgloveMessages:
    """Makes the messages of a robot's cycles.

    A number that is unknown is left out, and so is the target of a released servo. Nothing here
    raises: a measurement or command of another number of joints has no message.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        mounting = imu_in_torso(robot, robot.read_model().compile()) if robot.imu_site else None
        self._torso_in_imu = None if mounting is None else quaternion.inverse(mounting)

    def describe(self, cycle: Cycle, time_ns: int) -> Iterator[tuple[str, Json]]:
        """Yield the messages of a cycle at a wall time [ns since 1970], each with its topic."""
        seconds, nanoseconds = divmod(time_ns, SECOND)
        timestamp = {"sec": seconds, "nsec": nanoseconds}
        if joints := self._list_measured(cycle.state):
            yield JOINT_STATES, {"timestamp": timestamp, "joints": joints}
        if (joints := self._list_commanded(cycle.sent)) is not None:
            yield JOINT_COMMANDS, {"timestamp": timestamp, "joints": joints}
        if (rotation := self._turn(cycle.state.orientation)) is not None:
            yield (
                TRANSFORM,
                {
                    "timestamp": timestamp,
                    "parent_frame_id": WORLD,
                    "child_frame_id": self._robot.torso,
                    "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
                    "rotation": rotation,
                },
            )

    def _list_measured(self, state: State) -> list[Json]:
        if not self._fits(state.joint_pos, state.joint_vel, state.joint_current):
            return []
        torque = estimate_joint_torque(self._robot, state.joint_current)
        rows = np.stack((state.joint_pos, state.joint_vel, torque), axis=1)
        named = zip(self._robot.joint_names, rows.tolist(), strict=True)
        joints: list[Json] = [
            {"name": name, "position": angle, "velocity": speed, "effort": torque}
            for name, (angle, speed, torque) in named
        ]
        return joints if np.isfinite(rows).all() else list(map(_drop_unknown, joints))

    def _list_commanded(self, command: Command) -> list[Json] | None:
        if not self._fits(command.joint_pos, command.torque_limit):
            return None
        columns = self._robot.joint_names, command.joint_pos.tolist(), command.torque_limit.tolist()
        joints: list[Json] = [
            {"name": name, "position": target}
            for name, target, limit in zip(*columns, strict=True)
            if limit
        ]
        return joints if np.isfinite(command.joint_pos).all() else list(map(_drop_unknown, joints))

    def _turn(self, orientation: Array) -> Json | None:
        """Return the torso's orientation as a quaternion; None without or with an invalid one."""
        if self._torso_in_imu is None or np.shape(orientation) != (4,):
            return None
        turned = np.empty(4)
        mujoco.mju_mulQuat(turned, orientation, self._torso_in_imu)
        w, x, y, z = turned.tolist()
        return {"x": x, "y": y, "z": z, "w": w} if math.isfinite(w + x + y + z) else None

    def _fits(self, *values: Array) -> bool:
        return all(np.shape(value) == (self._robot.n,) for value in values)


def estimate_joint_torque(robot: Robot, current: Array) -> Array:
    """Estimate the torques at the joints [N·m] from motor currents [A], (..., n).

    The datasheet's stall point gives the ratio; gear friction is not in it.
    """
    return robot.transmission.torque_at_joint(current * robot.torque_per_ampere)


def _drop_unknown(joint: Json) -> Json:
    return {key: value for key, value in joint.items() if key == "name" or np.isfinite(value)}
