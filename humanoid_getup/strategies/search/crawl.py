"""Crawl: a search for moves that bring a lying robot to a place with more room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.disturbances.disturbance import Disturbance, Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.filtering.variation import limit_targets
from humanoid_getup.motions.population import CrossEntropy
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit
from robots.kinematics import place
from robots.quaternion import Array

SAMPLES, GENERATIONS = 20, 4
WORLDS = 3  # in which each move is tried, the first one undisturbed
KNOTS = 4  # postures of a move
MOVE, REST = 2.4, 0.6  # s of a move, and of the rest after it
MOST_SATURATION = 0.7  # s for which a servo may have all its torque without a break
SATURATION_COST = 1.0  # of a move in which one has it for longer, in the unit of the cost
SPREAD, LEAST_SPREAD = 0.8, 0.2  # rad, standard deviation of the first knots and of any


@dataclass(frozen=True, kw_only=True)
class Move:
    """Targets of a move, and the resulting postures."""

    target: Array
    """[rad], (T, n)"""
    qpos: Array
    """MuJoCo positions after each target, in the undisturbed world, (T, nq)."""
    cost: float
    """Cost in the worst world in which it was tried."""


class Crawl:
    """Samples moves of the whole body in simulation, by the cross-entropy method.

    An addition to [Lin12]: a robot under a table has to leave its place before it can rise, and
    how it can roll or crawl there is a matter of contacts, which no path of postures knows.
    """

    def __init__(
        self,
        world: World,
        torque_limit: TorqueLimit,
        disturbance: Disturbance,
        *,
        threads: int = 0,
    ) -> None:
        """Prepare for a world, and for disturbances that a move has to withstand."""
        self._world, self._limit, self._disturbance = world, torque_limit, disturbance
        self._experiment = Experiment(world, threads=threads)
        self.simulated = 0.0
        """Time simulated so far [s]."""

    def search(
        self,
        start: Posture,
        cost: Callable[[Array], Array],
        rng: np.random.Generator,
    ) -> Move | None:
        """Find the move from a posture at rest with the smallest cost in the worst of some worlds.

        If all diverge, there is none.

        Args:
            start: Where the robot lies.
            cost: Maps positions of the torso [m], (..., 3), to costs, (...).
            rng: Of the samples.
        """
        robot = self._world.robot
        lying = place(robot, self._world.model, start)
        scenarios = self._disturbance.sample(self._world, lying, WORLDS, rng, self._limit)
        held = start.joint_pos
        knots = CrossEntropy(
            np.tile(held, (KNOTS, 1)),
            SPREAD,
            SAMPLES,
            rng,
            least_spread=LEAST_SPREAD,
            bounds=(robot.lower, robot.upper),
        )
        best: Move | None = None
        for _ in range(GENERATIONS):
            targets = np.array([self._interpolate(held, one) for one in knots.ask()])
            outcome = self._play(scenarios, targets)
            qpos = outcome.record.qpos.reshape(SAMPLES, len(scenarios), len(targets[0]), -1)
            costs = cost(qpos[:, :, -1, robot.layout(self._world.model).root_position])
            saturated = (outcome.saturation > MOST_SATURATION).reshape(SAMPLES, -1)
            diverged = outcome.record.diverged.reshape(SAMPLES, -1)
            costs = np.where(diverged, np.inf, costs + SATURATION_COST * saturated).max(axis=1)
            cheapest = knots.tell(costs)[0]
            if costs[cheapest] < (best.cost if best else np.inf):
                best = Move(
                    target=targets[cheapest],
                    qpos=qpos[cheapest, 0].copy(),
                    cost=float(costs[cheapest]),
                )
        return best

    def _interpolate(self, held: Array, knots: Array) -> Array:
        """Compute the targets of a move through knots (KNOTS, n), then at rest, (T, n)."""
        period = self._world.robot.control_period
        at = np.arange(1, round((MOVE + REST) / period) + 1) * period
        times = np.linspace(0.0, MOVE, KNOTS + 1)
        rows = np.vstack([held, knots])
        straight = np.stack([np.interp(at, times, column) for column in rows.T], axis=1)
        return limit_targets(straight, held, self._world.robot)

    def _play(self, scenarios: Scenarios, targets: Array) -> Outcome:
        """Play moves (K, T, n) in every scenario, one move after the other."""
        sent = np.repeat(targets, len(scenarios), axis=0)
        record = self._experiment.play(scenarios.tile(len(targets)), sent)
        self.simulated += record.duration
        return Outcome(record, self._world.robot)
