"""Measured flight: where the robot of a flight log was, as far as its sensors tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import mujoco
import numpy as np
from numpy.typing import NDArray

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.playback.estimation import SINKING
from humanoid_getup.reporting.replay import ReplayReport
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import GeomReach, lowest_points, place_postures, torso_orientation
from robots.quaternion import Array

APART = 0.3  # rad between the tilts of two robots of which one may fall
TOUCHING = 0.003  # m above the lowest point, at which a part still touches the ground
UP = np.array([0.0, 0.0, 1.0])
# Servos round: a target to a tick of 1.5 mrad, a torque limit to a count of its current or PWM.
TARGET_ROUNDING = 0.005  # rad
TORQUE_ROUNDING = 0.05  # share of the limit
PAUSE = 0.1  # s between two cuts of one episode


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


def place_measured(world: World, record: FlightRecord, report: ReplayReport) -> Array:
    """Compute the MuJoCo positions of the robot as it was measured, (T, nq).

    Joint angles and attitude are measured; place and heading are not. The heading is the twin's at
    the first cycle, as an IMU counts its yaw from an arbitrary zero. The place is the twin's. On
    flat ground its height is such that the robot touches the ground; and once their tilts are far
    apart, as when the twin falls and the robot does not, what touches the ground stays where it
    is, so that the robot does not slide with its twin. What a log lacks, such as the angle of a
    servo that was silent, is the twin's.
    """
    layout, twin = world.robot.layout(world.model), report.twin_qpos
    angles = record.state["joint_pos"]
    qpos = place_postures(
        world.robot,
        world.model,
        twin[:, layout.root_position],
        _find_orientation(world, record, twin[:, layout.root_orientation]),
        np.where(np.isfinite(angles), angles, twin[:, layout.qpos]),
    )
    if world.scene.is_flat:
        apart = np.flatnonzero(np.nan_to_num(report.tilt_difference) > APART)
        first = int(apart[0]) if len(apart) else len(qpos)
        place = qpos[first:, layout.root_position]
        place[:, :2] = place[:1, :2]
        place[:, :2] += _stay_on_ground(world, qpos[first:])
        qpos[:, layout.root_qpos + 2] -= lowest_points(world.model, qpos) + SINKING
    return qpos


def _stay_on_ground(world: World, qpos: Array) -> Array:
    """Compute shifts of MuJoCo positions (T, nq) by which what touches the ground stays, (T, 2)."""
    data, reach = mujoco.MjData(world.model), GeomReach(world.model)
    shift, down = np.zeros((len(qpos), 2)), np.zeros((len(reach.geoms), 3))
    last, touching = None, np.zeros(len(reach.geoms), dtype=bool)
    for k, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(world.model, data)
        center, turn = data.geom_xpos[reach.geoms], data.geom_xmat[reach.geoms].reshape(-1, 3, 3)
        if last is not None:
            moved = center + np.einsum("gij,gj->gi", turn, down) - last
            shift[k] = shift[k - 1] - moved[touching, :2].mean(axis=0)
        depth = reach(turn[:, 2])  # (g,)
        height = center[:, 2] - depth
        touching = height < height.min() + TOUCHING
        down = -turn[:, 2] * depth[:, np.newaxis]  # in the geoms' frames, (g, 3)
        last = center - depth[:, np.newaxis] * UP
    return shift


def _find_orientation(world: World, record: FlightRecord, twin: Array) -> Array:
    """Return the measured orientations of the torso, (T, 4), turned to the heading of the twin."""
    measured = record.state["orientation"]
    known = np.isfinite(measured).all(axis=1) & (np.linalg.norm(measured, axis=1) > 0.5)
    if not known.any():
        return twin
    torso = torso_orientation(world.robot, world.model, quaternion.normalize(measured[known]))
    # The rotation about the vertical that takes the first one as near to the twin's as any.
    w, _, _, z = quaternion.multiply(twin[known][0], quaternion.inverse(torso[0]))
    turn = quaternion.from_yaw(2.0 * np.arctan2(z, w))
    orientation = twin.copy()
    orientation[known] = quaternion.multiply(turn, torso)
    return orientation


class CutKind(Enum):
    """What was cut of a command."""

    TARGET = "target"
    TORQUE = "torque limit"
    RELEASE = "torque"


@dataclass(frozen=True, kw_only=True)
class Cut:
    """An episode in which the commands of some joints were cut."""

    kind: CutKind
    joints: tuple[str, ...]
    begin: float
    """Since the first cycle [s]."""
    end: float
    """Of its last cycle [s]."""
    largest: float
    """Largest difference [rad], or [N·m] of torque."""

    def __str__(self) -> str:
        count = len(self.joints)
        joints = f"joint '{self.joints[0]}'" if count == 1 else f"{count} joints"
        unit = "rad" if self.kind is CutKind.TARGET else "N·m"
        size = f"cut by up to {self.largest:.2f} {unit}"
        what = "switched off" if self.kind is CutKind.RELEASE else size
        return f"{joints}: {self.kind.value} {what}, until {self.end:.2f} s"


def find_cuts(record: FlightRecord) -> tuple[Cut, ...]:
    """Find the episodes in which commands were cut, by joint and kind, in the order of time.

    These are the clips of the guard, targets that it held for lack of a measurement, and torque
    that it switched off after a fault. Joints that were cut in the same cycles are one episode.
    """
    if not record.cycles:
        return ()
    time = record.time - record.time[0]
    cuts = list[Cut]()
    for kind, size in _compare(record).items():
        together: dict[tuple[int, int], list[int]] = {}
        for joint, column in enumerate(size.T):
            for episode in _find_episodes(column > 0.0, time):
                together.setdefault(episode, []).append(joint)
        cuts += [
            Cut(
                kind=kind,
                joints=tuple(record.joint_names[joint] for joint in joints),
                begin=float(time[first]),
                end=float(time[last]),
                largest=float(size[first : last + 1, joints].max()),
            )
            for (first, last), joints in together.items()
        ]
    return tuple(sorted(cuts, key=lambda cut: cut.begin))


def _compare(record: FlightRecord) -> dict[CutKind, Array]:
    """Return how much was cut of each joint in each cycle, (T, n), by kind; 0 for nothing."""
    shape = record.sent["joint_pos"].shape
    target, torque = (
        _in_shape(record.tracks["asked"][name], shape) for name in ("joint_pos", "torque_limit")
    )
    sent_target, sent_torque = record.sent["joint_pos"], record.sent["torque_limit"]
    is_driven = (torque > 0.0) & (sent_torque > 0.0)
    moved, missing = np.abs(target - sent_target), torque - sent_torque
    return {
        CutKind.TARGET: np.where(is_driven & (moved > TARGET_ROUNDING), moved, 0.0),
        CutKind.TORQUE: np.where(is_driven & (missing > TORQUE_ROUNDING * torque), missing, 0.0),
        CutKind.RELEASE: np.where((torque > 0.0) & (sent_torque == 0.0), torque, 0.0),
    }


def _in_shape(values: np.ndarray, shape: tuple[int, ...]) -> Array:
    """Return rows of a shape; a command of another length, which no guard passes, is NaN."""
    if values.shape == shape:
        return values.astype(float)
    rows = np.full(shape, np.nan)
    for row, value in zip(rows, values, strict=False):
        if np.shape(value) == row.shape:
            row[:] = np.asarray(value, dtype=float)
    return rows


def _find_episodes(flags: NDArray[np.bool_], time: Array) -> Iterator[tuple[int, int]]:
    """Yield the first and last cycle of each episode of flags (T,), without longer pauses."""
    cycles = np.flatnonzero(flags)
    if len(cycles):
        breaks = np.flatnonzero(np.diff(time[cycles]) > PAUSE) + 1
        for run in np.split(cycles, breaks):
            yield int(run[0]), int(run[-1])
