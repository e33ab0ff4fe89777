"""A learned policy in place of a planned motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.strategies.plan import RisePlan, RiseStatus
from robots import Posture


@dataclass(frozen=True, kw_only=True)
class PolicyPlan(RisePlan):
    """The answer to how a robot gets up: as a policy decides on the way."""

    policy: OnnxPolicy
    name: str
    """Of the policy."""

    @property
    def title(self) -> str:
        """Name what is to be played."""
        return f"policy {self.name}"


class LearnedRise:
    """Chooses one policy, however the robot lies."""

    def __init__(self, policy: OnnxPolicy, name: str) -> None:
        self._policy, self._name = policy, name

    def plan(self, _start: Posture, _rng: np.random.Generator) -> PolicyPlan:
        """Choose the policy."""
        status = RiseStatus.LEARNED
        return PolicyPlan(status=status, reason=status.value, policy=self._policy, name=self._name)
