"""Options of `getup motions import`, `record` and `preview`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.cli.options.shared import BackendOptions
from humanoid_getup.jobs.requests.motions import KeyframesFile, NewKeysOptions
from humanoid_getup.jobs.requests.shared import RobotOption


@dataclass(frozen=True, kw_only=True)
class RecordMotion(NewKeysOptions, BackendOptions):
    """Record keys from a robot that is moved by hand, torque off.

    Enter or space takes the posture, backspace drops the last one, q finishes.
    """

    name: Positional[str]
    """Name of the new motion."""


@dataclass(frozen=True, kw_only=True)
class PreviewMotion(RobotOption):
    """Draw the keys of a motion, play them once as they are, and say how that ends.

    Above, each key without physics; below, the rollout, undisturbed and at full torque.
    """

    name: Positional[str]
    """Name of a motion in the keyframes."""
    keyframes: KeyframesFile = None
    """Keyframes file (.toml); default: the robot's keyframes.toml."""
    picture: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """Picture to write; default: NAME.png."""
