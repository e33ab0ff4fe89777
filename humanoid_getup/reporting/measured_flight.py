"""Measured flight: where the robot of a flight log was, as far as its sensors tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.experiments.judging.torque import estimate_torque
from humanoid_getup.playback.estimation import SINKING
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import lowest_points, place_postures, torso_orientation
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightPostures:
    """Postures of a robot, measured or simulated, in each cycle of a flight."""

    qpos: Array
    """MuJoCo positions, (T, nq)."""
    tilt: Array
    """Angle between the torso's axis and the vertical [rad], (T,)."""
    height: Array
    """Height of the torso's frame [m], (T,)."""

    @classmethod
    def of(cls, world: World, qpos: Array) -> FlightPostures:
        """Read tilt and height from MuJoCo positions (T, nq)."""
        layout = world.robot.layout(world.model)
        return cls(
            qpos=qpos,
            tilt=quaternion.tilt(qpos[:, layout.root_orientation]),
            height=qpos[:, layout.root_qpos + 2],
        )


def place_measured(world: World, record: FlightRecord, twin_qpos: Array) -> Array:
    """Compute the MuJoCo positions of the robot as it was measured, (T, nq).

    Joint angles and attitude are measured; place and heading are not, and are taken from the
    twin: the place in every cycle, the heading once, as an IMU counts its yaw from an arbitrary
    zero. On flat ground the height is such that the robot touches the ground, so that it neither
    floats nor sinks where the twin has fallen and the robot has not. What a log lacks, such as the
    angle of a servo that was silent, is the twin's.

    Args:
        world: Its world.
        record: Flight log of T cycles.
        twin_qpos: MuJoCo positions of the twin that replays it, (T, nq).
    """
    layout = world.robot.layout(world.model)
    angles = record.state["joint_pos"]
    qpos = place_postures(
        world.robot,
        world.model,
        twin_qpos[:, layout.root_position],
        _find_orientation(world, record, twin_qpos[:, layout.root_orientation]),
        np.where(np.isfinite(angles), angles, twin_qpos[:, layout.qpos]),
    )
    if world.scene.is_flat:
        qpos[:, layout.root_qpos + 2] -= lowest_points(world.model, qpos) + SINKING
    return qpos


def estimate_torques(world: World, record: FlightRecord) -> Array:
    """Estimate the torque of every servo from its current [N·m], (T, n); NaN where unknown."""
    return estimate_torque(world.robot, record.state["joint_current"])


def _find_orientation(world: World, record: FlightRecord, twin: Array) -> Array:
    """Return the measured orientations of the torso, (T, 4), turned to the heading of the twin."""
    measured = record.state["orientation"]
    known = np.isfinite(measured).all(axis=1) & (np.linalg.norm(measured, axis=1) > 0.5)
    if not known.any():
        return twin
    torso = torso_orientation(world.robot, world.model, quaternion.normalize(measured[known]))
    turn = _find_yaw(torso[0], twin[known][0])
    orientation = twin.copy()
    orientation[known] = quaternion.multiply(turn, torso)
    return orientation


def _find_yaw(p: Array, q: Array) -> Array:
    """Find the rotation about the vertical, (4,), that takes p (4,) as near to q (4,) as any."""
    w, _, _, z = quaternion.multiply(q, quaternion.inverse(p))
    return quaternion.from_yaw(2.0 * np.arctan2(z, w))
