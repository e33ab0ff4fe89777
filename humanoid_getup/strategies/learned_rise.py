"""A strategy that runs a learned policy instead of a planned motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from drivers import State
from humanoid_getup.playback.monitors import MonitorLimits
from humanoid_getup.playback.preflight import Verdict, preflight_robot
from humanoid_getup.playback.supervisor import Supervisor, supervise_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RisePlan, RiseStatus
from robots import Posture, TorqueLimit


@dataclass(frozen=True, kw_only=True)
class PolicyPlan(RisePlan):
    """A policy to be run; its torque limit was set when it was loaded."""

    policy: OnnxPolicy
    name: str
    """Name of the policy."""

    @property
    def title(self) -> str:
        """Name the policy."""
        return f"policy {self.name}"

    def controller(
        self, _world: World, _torque_limit: TorqueLimit, limits: MonitorLimits
    ) -> Supervisor:
        """Make the supervised policy."""
        return supervise_policy(self.policy, limits)

    def preflight(
        self,
        world: World,
        _torque_limit: TorqueLimit,
        settled: State,
        _measure: Callable[[], State],
    ) -> Verdict:
        """Judge supply and temperatures: the motion of a policy is not known beforehand."""
        return preflight_robot(world.robot, settled.voltage, settled.temperature)

    def record(self) -> dict[str, Any]:
        """Return the figures of the plan under report.json's keys."""
        return super().record() | {"policy": self.name}


class LearnedRise:
    """Runs one policy, for every start."""

    def __init__(self, policy: OnnxPolicy, name: str) -> None:
        self._policy, self._name = policy, name

    def plan(self, _start: Posture, _rng: np.random.Generator) -> PolicyPlan:
        """Plan to run the policy."""
        status = RiseStatus.LEARNED
        return PolicyPlan(status=status, reason=status.value, policy=self._policy, name=self._name)
