"""Plays keys once in physics, as they are, and measures how that ends."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import read_posture
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class KeysToPlay:
    """Keys of a robot."""

    robot: Robot
    keyframes: Keyframes


@dataclass(frozen=True, kw_only=True)
class KeyFigures:
    """Figures of a rollout."""

    torque_use: float
    """Largest driving torque of any servo as a share of its own."""
    rms_torque_nm: float
    peak_velocity_rad_s: float
    self_collisions: int | None
    limit_violations: int
    neck_delta_v_m_s: float | None
    """Largest change of the neck's velocity in a control period."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlayedKeys:
    """A rollout of keys on level ground, undisturbed and at full torque."""

    keyframes: Keyframes
    succeeded: bool
    description: str
    """How it ended, and why not as it should."""
    figures: KeyFigures
    rollout: Trajectory
    """What the robot did, from its start on; T samples."""
    target: Array
    """Targets of the servos [rad], (T, n)."""
    joint_torque: Array
    """Torques at the joints [N·m], (T, n)."""
    torque_use: Array
    """Largest torque of any servo as a share of its own, (T,)."""
    neck_share: Array
    """Height of the neck over that of the stance, (T,)."""
    key_time: Array
    """Times at which the targets were the keys [s], (K,); servos may need more time than asked."""

    def locate(self, number: int) -> Posture:
        """Return the posture of a key, counted from 0, where the robot was at its time."""
        last = len(self.rollout.time) - 1
        at = min(int(np.searchsorted(self.rollout.time, self.key_time[number])), last)
        return replace(self.rollout.posture(at), joint_pos=self.keyframes.keys[number])


def play_keys(
    request: KeysToPlay, report: Report | None = None, cancel: Cancel | None = None
) -> PlayedKeys:
    """Let a robot settle in the first key, and play the keys once.

    Raises:
        BadInputError: if there are fewer than two keys.
        CancelledError: if ``cancel`` ended it.
    """
    keyframes, robot = request.keyframes, request.robot
    if len(keyframes.keys) < 2:
        raise BadInputError(f"motion '{keyframes.name}' has one key, expected two or more")
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("playing the keys")
    trial = try_out(World(robot, FLAT_SCENE), keyframes)
    monitor.check()
    return _describe(trial)


def _describe(trial: Trial) -> PlayedKeys:
    record, world = trial.outcome.record, trial.world
    robot = world.robot
    first, layout = read_posture(robot, world.model, trial.start), record.layout
    count = len(record.qpos)
    return PlayedKeys(
        keyframes=trial.keyframes,
        succeeded=trial.succeeded,
        description=trial.describe(),
        figures=trial.outcome.figures(KeyFigures),
        rollout=Trajectory(
            time=float(record.period) * np.arange(count + 1.0),
            position=np.vstack([first.position, record.qpos[:, layout.root_position]]),
            orientation=np.vstack([first.orientation, record.orientation]),
            joint_pos=np.vstack([first.joint_pos, record.joint_pos]),
        ),
        target=np.vstack([trial.targets[:1], trial.targets[:count]]),
        joint_torque=_from_rest(robot.transmission.torque_at_joint(record.torque)),
        torque_use=_from_rest((np.abs(record.torque) / robot.max_torque).max(axis=-1)),
        neck_share=_repeat_first(record.stance.neck_height / robot.standing_neck_height),
        key_time=trial.keyframes.times(robot),
    )


def _from_rest(values: Array) -> Array:
    """Put zeros before samples (T, ...)."""
    return np.concatenate([np.zeros_like(values[:1]), values])


def _repeat_first(values: Array) -> Array:
    return np.concatenate([values[:1], values])
