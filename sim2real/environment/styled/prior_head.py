"""The head of a styled policy: outputs become postures, which a pose prior decodes."""

from __future__ import annotations

import numpy as np

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import UPRIGHT, Mirror
from humanoid_getup.style.curve_tracker import CurveTracker
from robots.quaternion import Array
from sim2real.environment.styled.ankle_balance import AnkleBalance
from sim2real.pose_prior.pose_prior import PosePrior

FILTER_SHARE = 0.4  # of a new output in the filtered one, each policy step
MOST_OUTPUT = 3.0  # largest output: latent parameters are standard normal over the postures
MOST_LATENT = 2.5  # of a posture that is encoded, so that the filter can follow
# Share of the neck height, and angle [rad], off the stance from which outputs count fully.
STANCE_HEIGHT, STANCE_ANGLE = 0.2, 0.5
LEAST_SCALE = 0.5
OFFSET_SCALE = 0.3  # rad of a joint's offset from the decoded posture by an output of one


class PriorHead:
    """Latent parameters and joint offsets, filtered, become postures ([Frezzato22], 3.4)."""

    limit = MOST_OUTPUT

    def __init__(self, action: ActionSpec, prior: PosePrior) -> None:
        """Prepare for actions that are postures of the prior's robot."""
        robot, k = prior.robot, prior.size
        self.prior, self._action = prior, action
        self.balance = AnkleBalance(robot)
        self.names = (*(f"latent {i}" for i in range(k)), *robot.joint_names)
        joints = Mirror(robot.mirror_index, robot.mirror_sign)
        self.mirror = Mirror.join((Mirror(np.arange(k), prior.latent_sign), joints))

    def act(
        self, outputs: Array, memory: Array, tracker: CurveTracker | None
    ) -> tuple[Array, Array]:
        """Filter the outputs, decode the posture, add offsets and the ankle balance.

        Raises:
            ValueError: without curves.
        """
        if tracker is None:
            raise ValueError("postures are decoded for style curves, expected a tracker of them")
        return self.decode(outputs, memory, tracker.wanted, tracker.features)

    def decode(
        self, outputs: Array, memory: Array, wanted: Array, measured: Array
    ) -> tuple[Array, Array]:
        """Compute actions and memory from wanted and measured style features, (N, 3)."""
        new = np.clip(outputs, -self.limit, self.limit)
        memory = FILTER_SHARE * new + (1.0 - FILTER_SHARE) * memory
        scaled = memory * scale_near_stance(measured)
        latent, offset = scaled[:, : self.prior.size], scaled[:, self.prior.size :]
        pos = self.prior.decode(latent, wanted) + OFFSET_SCALE * offset
        pos = pos + self.balance.correct(wanted, measured)
        return (pos - self._action.home) / self._action.scale, memory

    def invert(self, target: Array, memory: Array, wanted: Array, measured: Array) -> Array:
        """Compute outputs (N, m) that lead to joint targets [rad], (N, n), or close to them.

        The offsets supply what the latent parameters cannot reach.
        """
        following = self.remember(target, wanted, measured)
        outputs = (following - (1.0 - FILTER_SHARE) * memory) / FILTER_SHARE
        return np.clip(outputs, -self.limit, self.limit)

    def remember(self, target: Array, wanted: Array, measured: Array) -> Array:
        """Compute the memory (N, m) for the present and the last joint targets [rad], (N, n)."""
        scale = scale_near_stance(measured)
        target = target - self.balance.correct(wanted, measured)
        most = MOST_LATENT * scale
        latent = np.clip(self.prior.encode(target, wanted), -most, most)
        offset = (target - self.prior.decode(latent, wanted)) / OFFSET_SCALE
        memory = np.concatenate([latent, offset], axis=-1) / scale
        return np.clip(memory, -self.limit, self.limit)

    def offsets(self, memory: Array, measured: Array) -> Array:
        """Return the joint offsets from the decoded posture [rad], (N, n)."""
        return OFFSET_SCALE * (memory * scale_near_stance(measured))[:, self.prior.size :]


def scale_near_stance(measured: Array) -> Array:
    """Compute the factor on outputs, (N, 1), by the measured style features (N, 3).

    It is small for a robot that stands: outputs that explore, or answer delayed measurements, would
    make it fall. Its posture is then nearly the decoded one.
    """
    off = np.abs(measured - UPRIGHT - np.array([1.0, 0.0, 0.0]))
    far = (off / np.array([STANCE_HEIGHT, STANCE_ANGLE, STANCE_ANGLE])).max(axis=-1, keepdims=True)
    return np.clip(far, LEAST_SCALE, 1.0)
