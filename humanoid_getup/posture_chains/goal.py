"""Goals of a search for chains: a held stand, or a posture in which a robot rests on its way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import Bools, Record
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.posture_chains.features import ARRIVED, Meter, PostureMeter, StandMeter
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureMove, RestingState
from humanoid_getup.simulation.world import World
from robots.kinematics import place
from robots.quaternion import Array

TIMES = (1.0, 1.6, 3.0)  # s for OP3, of moves straight to a goal
SQUAT_MARGIN = 0.05  # of standing height that a squat on the way up may be lower


class Goal:
    """A held stand, which ends the way up of every robot."""

    is_stand = True
    """Whether squats lead to it."""

    def __init__(
        self, world: World, meter: Meter | None = None, moves: RandomMoves | None = None
    ) -> None:
        """Prepare for a world; a search for something else on the way measures that.

        The stance is that of the moves, if some are given, else that of the robot.
        """
        standing = moves.standing if moves else world.robot.standing
        self._stand = StandMeter(world)
        self.meter: Meter = meter or self._stand
        """Measures how near robots are to it."""
        self.qpos = place(world.robot, world.model, standing)
        """MuJoCo positions there, (nq,)."""
        self.target = moves.stance if moves else standing.joint_pos
        """Targets that are held there [rad], (n,)."""
        self.onward: tuple[PostureMove, ...] = ()
        """Moves from there to a held stand."""

    def is_passed(self, record: Record) -> Bools:
        """Tell which robots come to it on the way, if it is not the end of the way, (...)."""
        return np.ones(record.qpos.shape[:-2], dtype=bool)

    def is_reached(self, record: Record, samples: int) -> Bools:
        """Tell which robots are there over the last samples of a record, (N,)."""
        return np.all(record.upright[:, -samples:], axis=1)

    def measure_neck(self, qpos: Array) -> float:
        """Measure the height of the neck at MuJoCo positions (nq,), as a share of the stance's."""
        return float(self._stand.measure(qpos[None]).neck[0])

    def list_moves(
        self, state: RestingState, moves: RandomMoves, scale: float
    ) -> list[PostureMove]:
        """List moves from a state straight to the stance, and through higher squats."""
        least = self.measure_neck(state.qpos) - SQUAT_MARGIN
        higher = moves.squats.targets[moves.squat_necks > least]
        straight = [moves.rise(higher[:0], time * scale) for time in TIMES]
        return straight + [moves.rise(higher, time * scale) for time in TIMES[1:]]


class GoalExperiment(Experiment):
    """An experiment in which a rise that does not come to a goal on its way fails."""

    def __init__(self, goal: Goal, world: World, *, threads: int = 0) -> None:
        """Prepare for a world."""
        super().__init__(world, threads=threads)
        self._goal = goal

    def compare(
        self, scenarios: Scenarios, motions: Sequence[Array], *, give_up: bool = False
    ) -> Outcome:
        """Play the targets of S motions, (T, n) each, in K scenarios until known; (S, K)."""
        outcome = super().compare(scenarios, motions, give_up=give_up)
        record = outcome.record
        failed = record.failed | ~self._goal.is_passed(record)
        return replace(outcome, record=replace(record, failed=failed))


class PostureGoal(Goal):
    """A posture in which a robot rests, and from which it gets up."""

    is_stand = False

    def __init__(
        self,
        world: World,
        qpos: Array,
        target: Array,
        *,
        touches: bool,
        onward: tuple[PostureMove, ...] = (),
    ) -> None:
        """Go to MuJoCo positions (nq,), at which targets (n,) [rad] are held, then ``onward``.

        There, more than the feet ``touches`` the ground, or nothing else does.
        """
        self._posture = PostureMeter(world, qpos)
        super().__init__(world, self._posture)
        self.qpos, self.target, self.onward = qpos, target, onward
        self.touches = touches

    def is_reached(self, record: Record, samples: int) -> Bools:
        """Tell which robots are near to it at both ends of the last samples, (N,)."""
        ends = [self._is_near(record.qpos[:, at]) for at in (-samples, -1)]
        return np.all(ends, axis=0) & (record.stance.non_foot_contact[:, -1] == self.touches)

    def is_passed(self, record: Record) -> Bools:
        """Tell which robots come near to it, and touch the ground as there, (...)."""
        touches = record.stance.non_foot_contact == self.touches
        return np.any(self._is_near(record.qpos) & touches, axis=-1)

    def _is_near(self, qpos: Array) -> Bools:
        return self._posture.measure_progress(qpos) >= ARRIVED

    def list_moves(
        self, state: RestingState, moves: RandomMoves, scale: float
    ) -> list[PostureMove]:
        """List moves from a state straight there."""
        return [moves.aim(state.target, self.target, time * scale, "goal") for time in TIMES]
