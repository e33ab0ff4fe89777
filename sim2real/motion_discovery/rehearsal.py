"""Rehearsal: the targets of a learned rise played without the policy, disturbed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from humanoid_getup.experiments.play import Rollout, RolloutRandomization, Trace
from humanoid_getup.experiments.rise_figures import RiseFigures
from humanoid_getup.experiments.standing import HOLD_TIME, is_upright, judge, measure_stance
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.optimization import make_scenarios
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from sim2real.motion_discovery.learned_rise import LearnedRise
from sim2real.motion_discovery.shaping import shape

LIMIT_SHARE = 0.75  # of the strongest servo's torque: the torque limit that a motion must stand
FIRST, MORE, ALL = 2, 12, 48
"""Rollouts of a rehearsal: undisturbed, enough to compare, and as many as judge a built motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rehearsal:
    """Rollouts of one rise: undisturbed at the torque limit, at full torque, then disturbed."""

    rise: LearnedRise
    target: Array
    """[rad], (T, n)"""
    qpos: Array
    """MuJoCo positions of the first rollout at the end of each control period, (T + hold, nq)."""
    stood: np.ndarray
    """Of each rollout, (K,)."""
    stand_time: float
    """Of the first rollout [s]; nan without a stand."""
    rms_torque: float
    """Of the first rollout [N·m]."""

    @cached_property
    def share(self) -> float:
        """Return the share that stood; 0 if it fell undisturbed."""
        return float(self.stood.mean()) if self.stood[:FIRST].all() else 0.0


class RehearsalRoom:
    """Plays learned rises of one robot in one scene."""

    def __init__(self, world: World, seed: int, *, threads: int = 0) -> None:
        """Prepare to disturb by a seed: the same for all, so that they can be compared."""
        self._world, self._seed, self._threads = world, seed, threads
        self._rollouts: dict[int, Rollout] = {}
        self.torque_limit = LIMIT_SHARE * float(world.robot.max_torque.max())
        """At which motions must stand [N·m]."""

    def play(self, rise: LearnedRise, smoothing: float, count: int) -> Rehearsal:
        """Play a rise that is smoothed by a deviation [s], in so many rollouts."""
        return self._play(rise, shape(self._world.robot, rise, smoothing), count)

    def repeat(self, rehearsal: Rehearsal, count: int) -> Rehearsal:
        """Play a rise again in so many rollouts."""
        return self._play(rehearsal.rise, rehearsal.target, count)

    def _play(self, rise: LearnedRise, target: Array, count: int) -> Rehearsal:
        world, period = self._world, self._world.robot.control_period
        held = hold_last(target, len(target) + round((HOLD_TIME + period) / period))
        trace = self._roll_out(rise.start, held, count)
        stands = [
            judge(row, period) for row in is_upright(measure_stance(world, trace), world.robot)
        ]
        figures = RiseFigures.of_trace(trace, world, np.array([s.start_time for s in stands]))
        return Rehearsal(
            rise=rise,
            target=target,
            qpos=trace.qpos[0],
            stood=np.array([stand.stood for stand in stands]),
            stand_time=stands[0].start_time,
            rms_torque=float(figures.rms_torque[0]),
        )

    def _roll_out(self, start: Array, target: Array, count: int) -> Trace:
        starts, parameters = self._make_scenarios(start, count)
        if count not in self._rollouts:
            self._rollouts[count] = Rollout(self._world, count, threads=self._threads)
        return self._rollouts[count].play(starts, np.tile(target, (count, 1, 1)), parameters)

    def _make_scenarios(self, start: Array, count: int) -> tuple[Array, DomainParameters]:
        rng = np.random.default_rng([self._seed, count])
        return make_scenarios(
            self._world, start, self.torque_limit, count, RolloutRandomization(), rng
        )
