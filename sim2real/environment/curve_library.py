"""Builds the curves of a training from rises and from authored styles."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from humanoid_getup.style.curves import StyleCurves
from robots import Robot
from robots.kinematics import mirror_positions, place_postures
from robots.quaternion import Array
from sim2real.environment.style_task import LONGEST, CurveLibrary
from sim2real.pose_prior.rise_set import RiseSet

HELD_OUT = 10  # of so many rises one is kept from training, and with it its mirror image
SAMPLES = 65  # of the targets of a rise
FRAMES_APART = 3  # frames between two initial states along a rise, 0.14 s
LEAST_DURATION = 0.8  # s; shorter rises are leaps


def is_held_out(rise: int) -> bool:
    """Return whether a rise of a set is kept from training."""
    return rise % HELD_OUT == 0


def build_library(
    robot: Robot,
    model: mujoco.MjModel,
    rises: RiseSet,
    authored: Sequence[StyleCurves] = (),
    authored_share: float = 0.5,
) -> CurveLibrary:
    """Build the curves of a training: of rises and their mirror images, and authored ones."""
    curves: list[StyleCurves] = []
    states: list[Array] = []
    rows: list[int] = []
    shares: list[float] = []
    targets: list[Array] = []
    sources: list[str] = []
    placed = _place(robot, model, rises)
    mirrored = mirror_positions(robot, model, placed)
    for rise in range(len(rises)):
        first, end = int(rises.first[rise]), int(rises.first[rise + 1])
        if is_held_out(rise) or not LEAST_DURATION <= rises.duration(rise) <= LONGEST:
            continue
        try:
            curve = rises.curves(rise)
        except ValueError:  # it ends as it leans or squats, on the way to its stand
            continue
        target = _resample(rises.joint_target[first:end])
        targets += [target, robot.mirror_joints(target)]
        for qpos, own in ((placed, curve), (mirrored, curve.mirrored())):
            frames = np.arange(first, end, FRAMES_APART)
            states += list(qpos[frames])
            rows += [len(curves)] * len(frames)
            shares += list((frames - first) / (end - 1 - first))
            curves.append(own)
            sources.append(rises.sources[rise])
    targets += [np.full_like(targets[0], np.nan)] * len(authored)
    return CurveLibrary.of(
        [*curves, *authored],
        np.array(targets),
        [*sources, *[""] * len(authored)],
        authored_share,
        (np.array(states), np.array(rows), np.array(shares)),
    )


def _resample(rows: Array) -> Array:
    """Resample rows, (T, n), to `SAMPLES` equally spaced ones."""
    now, wanted = np.linspace(0.0, 1.0, len(rows)), np.linspace(0.0, 1.0, SAMPLES)
    return np.stack([np.interp(wanted, now, column) for column in rows.T], axis=-1)


def _place(robot: Robot, model: mujoco.MjModel, rises: RiseSet) -> Array:
    """Place the frames of rises in a model, (F, nq)."""
    own = robot.layout(rises.model)
    return place_postures(
        robot,
        model,
        rises.qpos[:, own.root_position],
        rises.qpos[:, own.root_orientation],
        rises.joint_pos,
    )
