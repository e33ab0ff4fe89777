"""Action heads: convert a network's outputs to actions, with a memory of the last ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from humanoid_getup.playback.balance import find_ankles
from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import UPRIGHT, Mirror
from humanoid_getup.simulation.world import World
from humanoid_getup.style.curve_tracker import CurveTracker
from robots import Robot
from robots.quaternion import Array
from sim2real.pose_prior import PRIOR, PosePrior


class DirectHead:
    """The outputs are the actions, and the memory is the last of them."""

    limit = 1.0

    def __init__(self, robot: Robot, action: ActionSpec) -> None:
        self.names = action.names
        self.mirror = Mirror(np.arange(action.size), action.mirror_sign(robot))

    def act(
        self, outputs: Array, _memory: Array, _tracker: CurveTracker | None
    ) -> tuple[Array, Array]:
        """Clip the outputs."""
        action = np.clip(outputs, -1.0, 1.0)
        return action, action


# Correction of the ankles per error of the side and of the front angle. Larger ones stand on
# steeper ground, and oscillate where targets are delayed by 0.06 s.
GAINS = np.array([0.3, 0.8])
LARGEST = 0.35  # rad
BEGIN, FULL = 0.80, 0.95  # neck heights from which it acts, and acts as a whole


class AnkleBalance:
    """Corrects the joint targets of robots that have nearly risen.

    An addition to [Frezzato22], whose policy moves ankles by itself: on ground that slopes under
    the feet, a robot that follows its curves with the ankles of level ground topples at their end.
    """

    def __init__(self, robot: Robot) -> None:
        self.ankles = find_ankles(World(robot, "flat"))
        """Changes of the joint angles per rotation of the torso to the side and front, (2, n)."""

    def correct(self, wanted: Array, measured: Array) -> Array:
        """Compute corrections of joint targets [rad], (N, n), from style features (N, 3)."""
        share = np.clip((measured[:, :1] - BEGIN) / (FULL - BEGIN), 0.0, 1.0)
        turn_back = np.clip(GAINS * (wanted - measured)[:, 1:], -LARGEST, LARGEST)
        return share * turn_back @ self.ankles


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

    @staticmethod
    def load(robot: Robot, action: ActionSpec, folder: Path) -> PriorHead:
        """Load the pose prior of a training."""
        return PriorHead(action, PosePrior.load(folder / PRIOR, robot))

    def act(
        self, outputs: Array, memory: Array, tracker: CurveTracker | None
    ) -> tuple[Array, Array]:
        """Filter the outputs, decode the posture, add offsets and the ankle balance."""
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
