"""The style task: which curves robots follow, how well, and when they have lost them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.observation import StyleInput, observe_style
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.features import angle_distance
from humanoid_getup.style.guide import StyleGuide
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.action_head import PriorHead
from sim2real.environment.privileged_state import PrivilegedState
from sim2real.pose_prior.rise_set import POLICY_SOURCE

NEAR = np.radians(30.0)  # largest angle between a start and the beginning of a curve
STAND_TIME = 3.0  # s that an episode goes on after its curve has ended
LOST_REWARD = 0.1  # of the task, below which a robot has lost its curve
LOST_TIME = 0.3  # s for which that, or the head on the ground, ends an episode
GRACE = 0.5  # s at the beginning of an episode in which it does not end
# A robot that lies has its head on the ground; one whose neck should be half way up must not.
HEAD_UP = 0.5
SHORTER, LONGER = 0.75, 1.5  # factors on a curve's duration
SHORTEST, LONGEST = 1.2, 6.0  # s
HEIGHT_WEIGHT = 2.5  # 1.7 per meter in the paper, whose human's neck is at 1.46 m
ANGLE_WEIGHT = 1.5  # 1/rad
SPEED_WEIGHT = 0.05  # s/rad
POSTURE_WEIGHT = 0.1  # 1/rad
PHASE_WEIGHT = 20.0
MOST_OFFSET = 0.2  # rad per joint on average, at which the naturalness is 0: 10 for 49 joints


@dataclass(frozen=True, kw_only=True, eq=False)
class StyleReward:
    """The factors of the reward of [Frezzato22], equations (3) to (9), for N robots."""

    height: Array
    angles: Array
    stillness: Array
    posture: Array
    natural: Array

    @property
    def task(self) -> Array:
        """Return the task reward, equation (4), (N,)."""
        return self.height * self.angles * self.stillness * self.posture

    @property
    def total(self) -> Array:
        """Return the reward, equation (2), (N,)."""
        return self.task * self.natural


def reward_style(
    features: Array, wanted: Array, speed: Array, away: Array, offsets: Array
) -> StyleReward:
    """Compute the reward of [Frezzato22], section 5.1.

    Args:
        features: Measured style features, (N, 3).
        wanted: Those of the curves, (N, 3).
        speed: Of joints and torso [rad/s], (N, m).
        away: Of each joint from standing [rad], (N, n).
        offsets: Of each joint's target from the decoded posture [rad], (N, n).
    """
    off = np.abs(features - wanted)
    phase = np.exp(-PHASE_WEIGHT * np.maximum(1.0 - wanted[:, 0], 0.0))

    def late(value: Array) -> Array:
        return (1.0 - phase) + phase * value

    offset = np.abs(offsets).mean(axis=1) / MOST_OFFSET
    return StyleReward(
        height=np.exp(-HEIGHT_WEIGHT * off[:, 0]),
        angles=np.exp(-ANGLE_WEIGHT * off[:, 1:].sum(axis=1)),
        stillness=late(np.exp(-SPEED_WEIGHT * np.linalg.norm(speed, axis=1))),
        posture=late(np.exp(-POSTURE_WEIGHT * np.abs(away).sum(axis=1))),
        natural=1.0 - np.clip(offset**2, 0.0, 1.0),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class CurveLibrary:
    """The curves of a training, and initial states along some of them."""

    pieces: Array
    """(C, 8, 4, 3)"""
    duration: Array
    """[s], (C,)"""
    is_stretched: NDArray[np.bool_]
    """Whether the duration may be changed; that of authored curves is chosen by hand, (C,)."""
    joint_target: Array
    """Targets of the servos at equally spaced shares of the duration [rad], (C, K, n): those of
    the rise that a curve is of; NaN for authored curves."""
    is_planned: NDArray[np.bool_]
    """Whether the targets are those of a motion, not of a policy, (C,)."""
    authored: float
    """Share of episodes with authored curves instead of those of rises."""
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
        authored: float,
        states: tuple[Array, NDArray[np.int_], Array],
    ) -> CurveLibrary:
        """Make a library from curves, the targets and sources of their rises, and states along.

        A source is empty for authored curves, of which a share of episodes takes one.
        """
        return CurveLibrary(
            authored=authored,
            pieces=np.array([curve.pieces for curve in curves]),
            duration=np.array([curve.duration for curve in curves]),
            is_stretched=np.array([bool(source) for source in sources]),
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

    def draw_near(self, features: Array, rng: np.random.Generator) -> NDArray[np.int_]:
        """Draw curves that begin near measured features (m, 3); the nearest if none does, (m,)."""
        distance = angle_distance(features[:, None], self.starts[None])  # (m, C)
        # Weighted draws without loops: the largest of u^(1/w) ([Efraimidis06]).
        weight = np.where(self.is_stretched, 1.0, self._authored_weight)
        drawn = -(rng.random(distance.shape) ** (1.0 / weight))
        return np.argmin(np.where(distance <= NEAR, drawn, distance), axis=1)

    @property
    def _authored_weight(self) -> float:
        """Return the weight of an authored curve, if one of a rise has 1."""
        authored = int(np.sum(~self.is_stretched))
        rises = len(self.is_stretched) - authored
        return self.authored / (1.0 - self.authored) * max(rises, 1) / max(authored, 1)

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
        return np.where(self.is_stretched[rows], drawn, self.duration[rows])


class StyleTask:
    """Curves that N robots follow in training, and when they have lost them."""

    def __init__(
        self, robot: Robot, n: int, library: CurveLibrary, head: PriorHead, threads: int = 0
    ) -> None:
        self.library, self.head = library, head
        self.input = StyleInput(memory=len(head.names))
        self.guide = StyleGuide(robot, n, threads)
        self.row = np.zeros(n, dtype=int)
        """Curve of each robot, (N,)."""
        self._age = np.zeros(n)  # since the beginning of the episode [s]
        self._lost = np.zeros(n)  # [s] for which the task reward was too low
        self._head_down = np.zeros(n)  # [s] for which the head was on the ground

    def begin(
        self, ids: NDArray[np.int_], rows: NDArray[np.int_], share: Array, rng: np.random.Generator
    ) -> Array:
        """Let some robots follow curves from shares of their durations; return the time left [s].

        A row of -1 stands for any curve that begins near to where the robot lies.
        """
        near = self.library.draw_near(self.guide.features[ids], rng)
        rows = np.where(rows < 0, near, rows)
        duration = self.library.draw_durations(rows, rng)
        time = share * duration
        self.guide.enter(ids, self.library.pieces[rows], duration, time)
        self.row[ids] = rows
        self._age[ids] = self._lost[ids] = self._head_down[ids] = 0.0
        return duration - time + STAND_TIME

    def observe(self) -> tuple[Array, Array]:
        """Build the terms of style."""
        return observe_style(self.guide.targets, self.guide.features)

    def advance(self, step_time: float) -> Array:
        """Advance the curves by a policy step [s]; return what is wanted then, (N, 3)."""
        self.guide.advance(step_time)
        self._age = self._age + step_time
        return self.guide.wanted

    def find_lost(
        self, reward: StyleReward, state: PrivilegedState, step_time: float
    ) -> NDArray[np.bool_]:
        """Find robots that have lost their curve, or whose head stays on the ground, (N,)."""
        down = state.head_contact & (self.guide.wanted[:, 0] > HEAD_UP)
        self._lost = np.where(reward.task < LOST_REWARD, self._lost + step_time, 0.0)
        self._head_down = np.where(down, self._head_down + step_time, 0.0)
        too_long = np.maximum(self._lost, self._head_down) > LOST_TIME
        return too_long & (self._age > GRACE)

    def save_state(self) -> dict[str, Any]:
        """Return the complete state, for :meth:`restore_state`."""
        arrays = {name: getattr(self, name).copy() for name in STATE}
        return {"guide": self.guide.save_state(), **arrays}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save_state`."""
        self.guide.restore_state(state["guide"])
        for name in STATE:
            setattr(self, name, state[name].copy())


STATE = ("row", "_age", "_lost", "_head_down")
