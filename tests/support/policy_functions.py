"""Policies that are written as functions of observations."""

from collections.abc import Callable

import numpy as np

from humanoid_getup.policy.observation import Floats
from robots.quaternion import Array
from sim2real.policy_evaluation import PolicyFunction


def remember_actions(act: Callable[[Floats], Array]) -> PolicyFunction:
    """Let a policy without a memory of its own remember its clipped actions."""

    def policy(observations: Floats) -> tuple[Array, Array]:
        actions = act(observations)
        return actions, np.clip(actions, -1.0, 1.0)

    return policy
