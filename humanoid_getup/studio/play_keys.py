"""Plays keys once in physics, as they are: on level ground, undisturbed and at full torque."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from robots import Robot


@dataclass(frozen=True, kw_only=True, eq=False)
class KeysToPlay:
    """Keys of a robot."""

    robot: Robot
    keyframes: Keyframes


def play_keys(
    request: KeysToPlay, report: Report | None = None, cancel: Cancel | None = None
) -> Trial:
    """Let a robot settle in the first key, and play the keys once.

    Raises:
        BadInputError: if there are fewer than two keys.
        CancelledError: if ``cancel`` ended it.
    """
    keyframes = request.keyframes
    if len(keyframes.keys) < 2:
        raise BadInputError(f"motion '{keyframes.name}' has one key, expected two or more")
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("playing the keys")
    trial = try_out(World(request.robot, FLAT_SCENE), keyframes)
    monitor.check()
    return trial
