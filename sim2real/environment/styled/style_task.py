"""The style task: the curves that robots follow in training, and the end of deviations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.observation import Sensed, StyleInput, observe_style
from humanoid_getup.style.curve_tracker import CurveTracker
from humanoid_getup.style.curves import SavedArrays, SavedState
from humanoid_getup.style.features import UNKNOWN
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.action_heads import PriorHead
from sim2real.environment.physics.training_simulation import TrainingSim
from sim2real.environment.privileged_state import PrivilegedState
from sim2real.environment.rewards import StyleReward, reward_style
from sim2real.environment.styled.curve_library import CurveLibrary

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
