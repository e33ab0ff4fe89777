"""Policies that are written as functions of observations."""

from collections.abc import Callable

import numpy as np

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.observation import Floats, StyleInput
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot
from robots.quaternion import Array


def make_policy(
    robot: Robot,
    action: ActionSpec,
    act: Callable[[Floats], Array],
    style: StyleInput | None = None,
) -> OnnxPolicy:
    """Make a policy of a function that maps observations to actions.

    It remembers its clipped actions, or 1 if it follows style curves.
    """

    def network(observations: Floats) -> tuple[Array, Array]:
        actions = act(observations)
        ones = np.ones((len(actions), 1))
        return actions, ones if style else np.clip(actions, -1.0, 1.0)

    contract = PolicyContract.of(robot, action, robot.control_period, {}, style)
    return OnnxPolicy(robot, contract, network)  # pyright: ignore[reportArgumentType]
