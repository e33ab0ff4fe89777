"""Action heads: how a network's outputs become actions, with a memory of the last ones."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import Mirror
from robots import Robot
from robots.quaternion import Array
from sim2real.pose_prior.pose_prior import PosePrior

FILTER_SHARE = 0.4  # of a new output in the filtered one, each policy step
MOST_OUTPUT = 3.0  # largest output: latent parameters are standard normal over the postures
MOST_LATENT = 2.5  # of a posture that is encoded, so that the filter can follow
OFFSET_SCALE = 0.3  # rad of a joint's offset from the decoded posture by an output of one


class ActionHead(Protocol):
    """Turns a network's outputs into actions of an :class:`ActionSpec`."""

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

    def act(self, outputs: Array, memory: Array, features: Array) -> tuple[Array, Array]:
        """Compute actions (N, k) and the next memory (N, m).

        Args:
            outputs: Of the network, (N, m).
            memory: Of the last policy step, (N, m).
            features: Style features that are wanted now, (N, 3).
        """
        ...


class DirectHead:
    """The outputs are the actions, and the memory is the last of them."""

    limit = 1.0

    def __init__(self, robot: Robot, action: ActionSpec) -> None:
        self.names = action.names
        self.mirror = Mirror(np.arange(action.size), action.mirror_sign(robot))

    def act(self, outputs: Array, _memory: Array, _features: Array) -> tuple[Array, Array]:
        """Clip the outputs."""
        action = np.clip(outputs, -1.0, 1.0)
        return action, action


class PriorHead:
    """Latent parameters and joint offsets, filtered, become postures ([Frezzato22], 3.4)."""

    limit = MOST_OUTPUT

    def __init__(self, action: ActionSpec, prior: PosePrior) -> None:
        """Prepare for actions that are postures of the prior's robot."""
        robot, k = prior.robot, prior.size
        self.prior, self._action = prior, action
        self.names = (*(f"latent {i}" for i in range(k)), *robot.joint_names)
        joints = Mirror(robot.mirror_index, robot.mirror_sign)
        self.mirror = Mirror.join((Mirror(np.arange(k), prior.latent_sign), joints))

    def act(self, outputs: Array, memory: Array, features: Array) -> tuple[Array, Array]:
        """Filter the outputs, decode the posture, and add the offsets."""
        new = np.clip(outputs, -self.limit, self.limit)
        memory = FILTER_SHARE * new + (1.0 - FILTER_SHARE) * memory
        pos = self.prior.decode(memory[:, : self.prior.size], features) + self.offsets(memory)
        return (pos - self._action.home) / self._action.scale, memory

    def invert(self, target: Array, memory: Array, features: Array) -> Array:
        """Compute outputs (N, m) that lead to joint targets [rad], (N, n), or near to them.

        What the latent parameters do not reach is left to the offsets.
        """
        wanted = self.remember(target, features)
        outputs = (wanted - (1.0 - FILTER_SHARE) * memory) / FILTER_SHARE
        return np.clip(outputs, -self.limit, self.limit)

    def remember(self, target: Array, features: Array) -> Array:
        """Compute the memory (N, m) of a robot whose joint targets are and were [rad], (N, n)."""
        latent = np.clip(self.prior.encode(target, features), -MOST_LATENT, MOST_LATENT)
        offset = (target - self.prior.decode(latent, features)) / OFFSET_SCALE
        return np.clip(np.concatenate([latent, offset], axis=-1), -self.limit, self.limit)

    def offsets(self, memory: Array) -> Array:
        """Return the joint offsets from the decoded posture [rad], (N, n)."""
        return OFFSET_SCALE * memory[:, self.prior.size :]
