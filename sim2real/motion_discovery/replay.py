"""Replays: the targets of a learned rise played open loop, disturbed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from humanoid_getup.experiments.disturbances.disturbance import USUAL
from humanoid_getup.experiments.judging.outcome import Outcome, compute_share
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.optimization import make_scenarios
from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from sim2real.motion_discovery.policy_rise import PolicyRise
from sim2real.motion_discovery.shaping import shape

LIMIT_SHARE = 0.75  # of the strongest servo's torque: the torque limit that a motion must stand
FIRST, MORE, ALL = 2, 12, 48
"""Counts of rollouts: undisturbed alone, for a comparison, and for a final judgment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """Rollouts of one rise: undisturbed at the torque limit, at full torque, then disturbed."""

    rise: PolicyRise
    target: Array
    """[rad], (T, n)"""
    stood: np.ndarray
    """Of each rollout, (K,)."""
    qpos: Array
    """MuJoCo positions of the first rollout at the end of each control period, (T + hold, nq)."""
    stand_time: float
    """Of the first rollout [s]; nan without a stand."""
    rms_torque: float
    """Of the first rollout [N·m]."""

    @cached_property
    def share(self) -> float:
        """Return the share that stood; 0 if it fell undisturbed."""
        return compute_share(self.stood, FIRST)


class Replayer:
    """Replays learned rises of one robot in one scene open loop."""

    def __init__(self, world: World, seed: int, *, threads: int = 0) -> None:
        """Draw the disturbances from a seed, the same for all rises, for comparison."""
        self._world, self._seed = world, seed
        self._experiment = Experiment(world, threads=threads)
        self.torque_limit = LIMIT_SHARE * float(world.robot.max_torque.max())
        """Torque limit under which motions must stand [N·m]."""

    def play(self, rise: PolicyRise, smoothing: float, count: int) -> Replay:
        """Replay a rise smoothed with a standard deviation [s], in a number of rollouts."""
        return self._play(rise, shape(self._world.robot, rise, smoothing), count)

    def repeat(self, replay: Replay, count: int) -> Replay:
        """Replay a rise again in a number of rollouts."""
        return self._play(replay.rise, replay.target, count)

    def _play(self, rise: PolicyRise, target: Array, count: int) -> Replay:
        world, period = self._world, self._world.robot.control_period
        held = hold_last(target, len(target) + round((HOLD_TIME + period) / period))
        rng = np.random.default_rng([self._seed, count])
        scenarios = make_scenarios(world, rise.start, self.torque_limit, count, USUAL, rng)
        record = self._experiment.play(scenarios, [held] * count)
        outcome = Outcome(record, world.robot)
        return Replay(
            rise=rise,
            target=target,
            stood=outcome.stood,
            qpos=outcome.qpos[0],
            stand_time=float(outcome.stand_time[0]),
            rms_torque=float(outcome.rms_torque[0]),
        )
