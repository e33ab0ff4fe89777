"""Request to replay a flight log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.jobs.requests.files import READ, ROBOT, Written
from humanoid_getup.jobs.requests.shared import JobRequest
from humanoid_getup.jobs.requests.values import between

REPLAY_FILES = ("replay.json", "flight.png", "replay.png", "style.png")


@dataclass(frozen=True, kw_only=True)
class ReplayRequest(JobRequest):
    """Replay a flight log on the twin and report the differences."""

    log: Annotated[Positional[Path], READ, arg(metavar="LOG")]
    """A flight log (.mcap)."""
    robot: Annotated[str | None, ROBOT] = None
    """Name of a robot, or a folder with a robot.toml; default: the log's robot."""
    scene: Annotated[str | None, READ] = None
    """Name of a scene; default: the log's scene, else flat."""
    voltage: Annotated[float | None, between(1.0, 100.0, "V"), arg(metavar="V")] = None
    """Supply voltage of the twin [V]; default: as measured at the start."""
    threshold: Annotated[float | None, between(1e-9, 10.0, "rad"), arg(metavar="RAD")] = None
    """Difference of a joint or of the tilt from which the replay has diverged [rad];
    default: 0.05."""
    out: Annotated[Path | None, Written(REPLAY_FILES), arg(metavar="DIR")] = None
    """Folder for replay.json, flight.png and replay.png."""
