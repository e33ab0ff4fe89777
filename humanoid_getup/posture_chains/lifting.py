"""Lifting: whether servos are strong enough to rise from squats, and which one is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.posture_chains.move_player import measure_time_scale
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureMove, sample_moves
from humanoid_getup.posture_chains.ways_up import HOLDING, SQUAT_TIME
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.body.squats import DEEP_ENOUGH
from robots.kinematics import place
from robots.quaternion import Array

FACTORS = (1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0, 300.0)
"""On the servos' torque, tried in this order."""
MOST_SQUATS = 2 / 3  # of the squats from which a robot rises with all its torque
AT_LIMIT = 0.9  # share of a limit from which a servo is at it: registers round small ones down
STRAINED = 0.05  # share of the time below which the limit of a servo is not what a rise fails by


@dataclass(frozen=True, kw_only=True)
class Lifting:
    """What keeps a robot from rising out of a squat."""

    neck: float
    """Height of the neck in the squat, as a share of that of the stance."""
    joint: str
    """The joint whose servo is at its limit longest."""
    at_limit: float
    """Share of the time for which it is."""
    torque: float
    """That limit [N·m]."""
    factor: float
    """Least factor on all torques with which the robot rises."""

    def describe(self) -> str:
        """Describe it in one line."""
        return (
            f"the servos do not lift the robot out of a squat with its neck at {self.neck:.0%}: "
            f"joint '{self.joint}' is at its limit of {self.torque:.3g} N·m for "
            f"{self.at_limit:.0%} of the time; with {self.factor:g} times the torque, "
            f"{self.factor * self.torque:.3g} N·m, it rises"
        )


def find_least_share(
    world: World, moves: RandomMoves, limit: TorqueLimit, shares: Sequence[float]
) -> float:
    """Find the first share of a torque limit with which a robot rises from most of its squats.

    Those are `MOST_SQUATS` of the squats from which it does under the limit; 1 if no share is
    enough.
    """
    able = find_rises(world, moves, limit)
    for share in shares:
        if able.any() and find_rises(world, moves, limit, share)[able].mean() >= MOST_SQUATS:
            return share
    return 1.0


def find_rises(
    world: World, moves: RandomMoves, limit: TorqueLimit, share: float = 1.0
) -> NDArray[np.bool_]:
    """Find from which squats a robot rises with a share of a torque limit, undisturbed, (Q,)."""
    if not len(moves.squats):
        return np.zeros(0, dtype=bool)
    rises = [_Rise(world, moves, squat) for squat in range(len(moves.squats))]
    scenarios = Scenarios.nominal(world, np.array([rise.start for rise in rises]), limit)
    scenarios.parameters.torque_limit[:] *= share
    targets = [rise.targets for rise in rises]
    return Outcome(Experiment(world).play(scenarios, targets, stop_early=True), world.robot).stood


def check_lifting(world: World, moves: RandomMoves, limit: TorqueLimit) -> Lifting | None:
    """Let a robot rise from a deep squat; None if it does, or does not for want of balance."""
    deep = np.flatnonzero(moves.squat_necks <= DEEP_ENOUGH)
    if not deep.size:
        return None
    rise = _Rise(world, moves, int(deep[0]))
    outcome = rise.play(limit, 1.0)
    if outcome.stood[0]:
        return None
    joint, at_limit, torque = _find_strained(world, outcome, limit)
    if at_limit < STRAINED:
        return None
    factor = next((factor for factor in FACTORS if rise.play(limit, factor).stood[0]), None)
    if factor is None:
        return None
    neck = float(moves.squat_necks[deep[0]])
    return Lifting(neck=neck, joint=joint, at_limit=at_limit, torque=torque, factor=factor)


class _Rise:
    """The rise from one squat through the higher ones."""

    def __init__(self, world: World, moves: RandomMoves, squat: int) -> None:
        self._world, self._experiment = world, Experiment(world, threads=1)
        robot, targets = world.robot, moves.squats.targets
        scale = measure_time_scale(robot)
        self._full = float(robot.max_torque.max())
        self.start = place(robot, world.model, moves.squats.postures[squat])
        way = [
            PostureMove(knots=targets[squat][None], duration=HOLDING * scale, kind="hold"),
            moves.rise(targets[:squat], SQUAT_TIME * scale),
        ]
        self.targets = sample_moves(targets[squat], way, robot.control_period, HOLDING * scale)

    def play(self, limit: TorqueLimit, factor: float) -> Outcome:
        scenarios, full = Scenarios.nominal(self._world, self.start, limit), self._full
        scenarios.parameters.torque_limit[:] *= factor
        beyond = np.max(scenarios.parameters.torque_limit) / full
        scenarios.parameters.strength[:] *= max(beyond, 1.0)  # only above what the servos have
        record = self._experiment.play(scenarios, [self.targets], stop_early=True)
        return Outcome(record, self._world.robot)


def _find_strained(world: World, outcome: Outcome, limit: TorqueLimit) -> tuple[str, float, float]:
    """Find the joint whose servo is at its limit longest, the share of the time, and the limit."""
    robot = world.robot
    full = robot.max_torque * robot.supply_voltage / robot.nominal_voltage
    most: Array = full if limit.value is None else np.minimum(full, limit.value)
    torque = np.abs(outcome.record.torque[0, : outcome.record.cycles[0]])
    at_limit = np.mean(torque >= AT_LIMIT * most, axis=0)
    worst = int(np.argmax(at_limit))
    return robot.joint_names[worst], float(at_limit[worst]), float(most[worst])
