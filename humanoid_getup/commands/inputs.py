"""What commands are told: the shared options, and how they are checked and loaded."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from humanoid_getup.commands.outputs import find_folder_faults, find_json_faults
from humanoid_getup.database import load_database
from humanoid_getup.lying import CLASSES, Fall, classify, sample_falls
from humanoid_getup.motion import Motion
from humanoid_getup.rehearsal import Stage
from humanoid_getup.rise import check_start
from humanoid_getup.scene import Scene, load_scene
from robots import Robot, load_posture, load_robot

BACKENDS = ("twin",)
UNCLASSED = "other"  # start class of a posture that lies on no side


class BadInputError(Exception):
    """What the user gave cannot be used; the message names culprit, value and what is allowed."""


@contextmanager
def refusing() -> Iterator[None]:
    """Turn what a loader raises about a user's input into a `BadInputError`."""
    try:
        yield
    except ValueError as error:
        raise BadInputError(str(error)) from error
    except OSError as error:
        raise BadInputError(f"{error.filename}: {error.strerror}") from error


@dataclass(frozen=True, kw_only=True)
class RobotOption:
    """Which robot."""

    robot: str = "op3"
    """Robot by name, or a folder that holds a robot.toml."""

    def load_robot(self) -> Robot:
        """Load the robot."""
        with refusing():
            return load_robot(self.robot)


@dataclass(frozen=True, kw_only=True)
class SceneOptions(RobotOption):
    """Which robot, where, from which seed, and where the figures go."""

    scene: str = "flat"
    """Scene by name."""
    seed: int = 0
    """Of everything that is drawn by chance, 0 or more."""
    json: tyro.conf.StrOrNone = None  # type: ignore[name-defined]
    """File for the figures as JSON; - prints them alone on standard output."""


@dataclass(frozen=True, kw_only=True)
class TrialOptions(SceneOptions):
    """What every command that moves a robot is told."""
