"""The style task: the curves that robots follow in training, and the end of deviations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.observation import Sensed, StyleInput, observe_style
from humanoid_getup.style.curve_tracker import CurveTracker
from humanoid_getup.style.curves import SavedArrays, SavedState, StyleCurves
from humanoid_getup.style.features import UNKNOWN, angle_distance
from humanoid_getup.style.style import list_styles, load_style
from robots import Robot
from robots.body.parts import leg_length
from robots.kinematics import mirror_positions, transfer_positions
from robots.quaternion import Array
from sim2real.environment.action_heads import PriorHead
from sim2real.environment.rewards import PrivilegedState, StyleReward, reward_style
from sim2real.environment.training_simulation import TrainingSim
from sim2real.pose_prior import POLICY_SOURCE, RiseSet

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
        if rise % HELD_OUT == 0 or not LEAST_DURATION <= rises.duration(rise) <= LONGEST:
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


DURATIONS, LEGS = (2.5, 5.1, 7.6), 0.9  # s that a person of such legs [m] takes in [Frezzato22]


def list_named_curves(robot: Robot) -> Iterator[StyleCurves]:
    """List the named styles' curves and their mirror images.

    Their durations are their own, and all but the shortest of the paper's.
    """
    scale = math.sqrt(leg_length(robot) / LEGS)
    for name in list_styles():
        for curve in load_style(name, robot).curves:
            # The shortest is beyond what position servos of a small robot can follow.
            for duration in {curve.duration, *(scale * duration for duration in DURATIONS[1:])}:
                timed = curve.lasting(duration)
                yield timed
                if not np.allclose(timed.side, np.pi / 2):
                    yield timed.mirrored()


STAND_TIME = 3.0  # s that an episode continues after its curve has ended
TERMINATION_REWARD = 0.1  # of the task, below which a robot deviates too much from its curves
TERMINATION_TIME = 0.3  # s for which that, or the head on the ground, ends an episode
GRACE = 0.5  # s at the beginning of an episode in which it does not end
# A robot that lies has its head on the ground; one whose neck should be half way up must not.
HEAD_UP = 0.5
KNOWN = 0.5  # share of episodes in which a policy with a height map gets it


class StyleTask(SavedArrays):
    """Curves that N robots follow in training, and early termination of their episodes."""

    saved = ("row", "_knows", "_age", "_deviating", "_head_down")

    def __init__(
        self,
        robot: Robot,
        n: int,
        library: CurveLibrary,
        head: PriorHead,
        threads: int = 0,
        *,
        height_map: bool = False,
    ) -> None:
        self.library, self.head = library, head
        self.input = StyleInput(memory=len(head.names), height_map=height_map)
        self.tracker = CurveTracker(robot, n, threads)
        self.row = np.zeros(n, dtype=int)
        """Curve of each robot, (N,)."""
        self._knows = np.zeros(n, dtype=bool)  # the ground around it
        self._age = np.zeros(n)  # since the beginning of the episode [s]
        self._deviating = np.zeros(n)  # [s] for which the task reward was too low
        self._head_down = np.zeros(n)  # [s] for which the head was on the ground

    def begin(
        self,
        ids: NDArray[np.int_],
        rows: NDArray[np.int_],
        share: Array,
        sensed: Sensed,
        rng: np.random.Generator,
    ) -> Array:
        """Start some robots on curves, at shares of their durations; return the time left [s].

        A row of -1 stands for any curve that begins near to how the robot lies. Measurements are
        those of all robots.
        """
        self.tracker.measure(sensed.gravity, sensed.joint_pos)
        near = self.library.draw_near(self.tracker.features[ids], rng)
        rows = np.where(rows < 0, near, rows)
        duration = self.library.draw_durations(rows, rng)
        time = share * duration
        self.tracker.enter(ids, self.library.pieces[rows], duration, time)
        self.row[ids] = rows
        if self.input.height_map:
            self._knows[ids] = rng.random(len(ids)) < KNOWN
        self._age[ids] = self._deviating[ids] = self._head_down[ids] = 0.0
        return duration - time + STAND_TIME

    def remember(self, ids: NDArray[np.int_], target: Array) -> Array:
        """Compute the memory for the present and the last targets [rad], (m, n)."""
        tracker = self.tracker
        return self.head.remember(target, tracker.wanted[ids], tracker.features[ids])

    def observe(self, sim: TrainingSim) -> Sequence[Array]:
        """Build the terms of style."""
        terms = observe_style(self.tracker.targets, self.tracker.features)
        if not self.input.height_map:
            return terms
        return *terms, np.where(self._knows[:, np.newaxis], sim.measure_height_map(), UNKNOWN)

    def follow(self, sim: TrainingSim, sensed: Sensed, memory: Array) -> StyleReward:
        """Advance the curves by a policy step; compute the reward for following them."""
        self._age = self._age + sim.step_time
        self.tracker.advance(sim.step_time)
        self.tracker.measure(sensed.gravity, sensed.joint_pos)
        robot, layout, qvel = sim.robot, sim.robot.layout(sim.model), sim.read("qvel")
        turning = slice(layout.root_dof + 3, layout.root_dof + 6)
        return reward_style(
            sim.measure_features(),
            self.tracker.wanted,
            np.concatenate([qvel[:, layout.dof], qvel[:, turning]], axis=1),
            sensed.joint_pos - robot.standing.joint_pos,
            self.head.offsets(memory, self.tracker.features),
        )

    def find_terminated(
        self, reward: StyleReward, state: PrivilegedState, step_time: float
    ) -> NDArray[np.bool_]:
        """Find robots that deviate too long, or have the head on the ground too long, (N,)."""
        down = state.head_contact & (self.tracker.wanted[:, 0] > HEAD_UP)
        is_off = reward.task < TERMINATION_REWARD
        self._deviating = np.where(is_off, self._deviating + step_time, 0.0)
        self._head_down = np.where(down, self._head_down + step_time, 0.0)
        too_long = np.maximum(self._deviating, self._head_down) > TERMINATION_TIME
        return too_long & (self._age > GRACE)

    def save_state(self) -> SavedState:
        """Return the complete state, for :meth:`restore_state`."""
        return {"tracker": self.tracker.save_state(), **super().save_state()}

    def restore_state(self, state: SavedState) -> None:
        """Restore a state of :meth:`save_state`."""
        self.tracker.restore_state(state["tracker"])
        super().restore_state(state)
