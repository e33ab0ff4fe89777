"""Action heads: convert a network's outputs to actions, with a memory of the last ones."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import Mirror, mirror_of_actions
from humanoid_getup.style.curve_tracker import CurveTracker
from robots import Robot
from robots.quaternion import Array


class ActionHead(Protocol):
    """Converts a network's outputs to actions of an :class:`ActionSpec`."""

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the outputs, which are also those of the memory."""
        ...

    @property
    def limit(self) -> float:
        """Return the largest output that is not clipped."""
        ...

    @property
    def mirror(self) -> Mirror:
        """Return how left and right are exchanged in outputs and in the memory."""
        ...

    def act(
        self, outputs: Array, memory: Array, tracker: CurveTracker | None, /
    ) -> tuple[Array, Array]:
        """Compute actions (N, k) and the next memory (N, m).

        Args:
            outputs: Of the network, (N, m).
            memory: Of the last policy step, (N, m).
            tracker: Curves that the robots follow; ``None`` for none.
        """
        ...


class DirectHead:
    """The outputs are the actions, and the memory is the last of them."""

    limit = 1.0

    def __init__(self, robot: Robot, action: ActionSpec) -> None:
        self.names = action.names
        self.mirror = mirror_of_actions(robot, action)

    def act(
        self, outputs: Array, _memory: Array, _tracker: CurveTracker | None
    ) -> tuple[Array, Array]:
        """Clip the outputs."""
        action = np.clip(outputs, -1.0, 1.0)
        return action, action
