"""The curves of a training, of rises and of named styles, and initial states along rises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.features import angle_distance
from robots import Robot
from robots.kinematics import mirror_positions, transfer_positions
from robots.quaternion import Array
from sim2real.pose_prior.rise_set import POLICY_SOURCE, RiseSet

HELD_OUT = 10  # of so many rises one is kept from training, and with it its mirror image
SAMPLES = 65  # of the targets of a rise
FRAMES_APART = 3  # frames between two initial states along a rise, 0.14 s
LEAST_DURATION = 0.8  # s; shorter rises are leaps
NEAR = np.radians(30.0)  # largest angle between a start and the beginning of a curve
SHORTER, LONGER = 0.85, 1.5  # factors on a curve's duration
SHORTEST, LONGEST = 1.2, 6.0  # s


@dataclass(frozen=True, kw_only=True, eq=False)
class CurveLibrary:
    """The curves of a training, and initial states along some of them."""

    pieces: Array
    """(C, 8, 4, 3)"""
    duration: Array
    """[s], (C,)"""
    is_of_rise: NDArray[np.bool_]
    """Whether each is of a rise, so that its duration may be changed, (C,)."""
    joint_target: Array
    """Targets of the servos at equally spaced shares of the duration [rad], (C, K, n): those of
    the rise that a curve is of; NaN for named curves."""
    is_planned: NDArray[np.bool_]
    """Whether the targets are those of a motion, not of a policy, (C,)."""
    named_share: float
    """Share of draws that are named curves, where both kinds begin near."""
    state_qpos: Array
    """MuJoCo positions of the robot along the curves, (S, nq)."""
    state_curve: NDArray[np.int_]
    """Curve of each such state, (S,)."""
    state_share: Array
    """Share of the curve's duration at each such state, (S,)."""

    @staticmethod
    def of(
        curves: Sequence[StyleCurves],
        joint_target: Array,
        sources: Sequence[str],
        named_share: float,
        states: tuple[Array, NDArray[np.int_], Array],
    ) -> CurveLibrary:
        """Make a library of C curves; a source tells where each rise comes from, "" for named ones.

        The states are MuJoCo positions along the curves, and curve and share of each.
        """
        return CurveLibrary(
            named_share=named_share,
            pieces=np.array([curve.pieces for curve in curves]),
            duration=np.array([curve.duration for curve in curves]),
            is_of_rise=np.array([bool(source) for source in sources]),
            joint_target=joint_target,
            is_planned=np.array([bool(s) and not s.startswith(POLICY_SOURCE) for s in sources]),
            state_qpos=states[0],
            state_curve=states[1],
            state_share=states[2],
        )

    @property
    def starts(self) -> Array:
        """Return the features at the beginning of each curve, (C, 3)."""
        return self.pieces[:, 0, 3]

    def find_near(self, features: Array) -> NDArray[np.bool_]:
        """Find measured features (m, 3) near the beginning of any curve, (m,)."""
        distance = angle_distance(features[:, None], self.starts[None])
        return np.any(distance <= NEAR, axis=1)

    def draw_near(self, features: Array, rng: np.random.Generator) -> NDArray[np.int_]:
        """Draw curves that begin near measured features (m, 3); the nearest if none does, (m,)."""
        distance = angle_distance(features[:, None], self.starts[None])  # (m, C)
        is_for_named = rng.random((len(features), 1)) < self.named_share
        # The first of a random order, in which the preferred kind is before the other.
        place = rng.random(distance.shape) - (is_for_named != self.is_of_rise) - 1.0
        return np.argmin(np.where(distance <= NEAR, place, distance), axis=1)

    def interpolate_targets(self, rows: NDArray[np.int_], share: Array) -> Array:
        """Interpolate the targets of curves at shares of their durations, (m,), as (m, n)."""
        last = self.joint_target.shape[1] - 1
        at = np.clip(share, 0.0, 1.0) * last
        k = np.minimum(at.astype(int), last - 1)
        before, after = self.joint_target[rows, k], self.joint_target[rows, k + 1]
        return before + (at - k)[:, None] * (after - before)

    def draw_durations(self, rows: NDArray[np.int_], rng: np.random.Generator) -> Array:
        """Draw durations of curves [s], (m,)."""
        factor = np.exp(rng.uniform(np.log(SHORTER), np.log(LONGER), len(rows)))
        drawn = np.clip(self.duration[rows] * factor, SHORTEST, LONGEST)
        return np.where(self.is_of_rise[rows], drawn, self.duration[rows])


def is_held_out(rise: int) -> bool:
    """Return whether a rise of a set is kept from training."""
    return rise % HELD_OUT == 0


def build_library(
    robot: Robot,
    model: mujoco.MjModel,
    rises: RiseSet,
    named: Sequence[StyleCurves] = (),
    named_share: float = 0.5,
) -> CurveLibrary:
    """Build the curves of a training: of rises and their mirror images, and named ones."""
    curves, sources = list[StyleCurves](), list[str]()
    states, targets = list[Array](), list[Array]()
    rows, shares = list[int](), list[float]()
    placed = transfer_positions(robot, rises.model, model, rises.qpos)
    mirrored = mirror_positions(robot, model, placed)
    for rise in range(len(rises)):
        first, end = int(rises.first[rise]), int(rises.first[rise + 1])
        if is_held_out(rise) or not LEAST_DURATION <= rises.duration(rise) <= LONGEST:
            continue
        try:
            curve = rises.curves(rise)
        except ValueError:  # it ends as it leans or squats, on the way to its stand
            continue
        now, wanted = np.linspace(0.0, 1.0, end - first), np.linspace(0.0, 1.0, SAMPLES)
        columns = rises.joint_target[first:end].T
        target = np.stack([np.interp(wanted, now, column) for column in columns], axis=-1)
        targets += [target, robot.mirror_joints(target)]
        for qpos, own in ((placed, curve), (mirrored, curve.mirrored())):
            frames = np.arange(first, end, FRAMES_APART)
            # A third are where a rise begins: falls with the curves that were planned for them.
            frames = np.concatenate([np.full(len(frames) // 2, first), frames])
            states += list(qpos[frames])
            rows += [len(curves)] * len(frames)
            shares += list((frames - first) / (end - 1 - first))
            curves.append(own)
            sources.append(rises.sources[rise])
    targets += [np.full_like(targets[0], np.nan)] * len(named)
    along = np.array(states), np.array(rows), np.array(shares)
    sources += [""] * len(named)
    return CurveLibrary.of([*curves, *named], np.array(targets), sources, named_share, along)
