"""The flight record: a flight log read back as arrays."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import zstandard
from mcap.exceptions import McapError
from mcap.writer import MCAP0_MAGIC

from drivers.flight_content import Content, Event, Track
from drivers.flight_log import FORMAT, TOPICS
from drivers.state import Command, State
from robots import Posture, Robot
from robots.rotation import Array

DAMAGE = (
    *(McapError, zstandard.ZstdError, struct.error, MemoryError, RecursionError),
    *(ValueError, TypeError, KeyError, IndexError, OverflowError),
)
"""What reading a damaged log may raise."""
NEEDED = ("state", "asked", "sent")


__all__ = ["Event", "FlightRecord", "Track"]


@dataclass(frozen=True, kw_only=True)
class FlightRecord:
    """A flight log as arrays."""

    path: Path
    robot: str
    joint_names: tuple[str, ...]
    period: float
    """The robot's control period [s]."""
    started: str
    """Date and time of the start, ISO 8601, UTC."""
    about: Mapping[str, str | float | int]
    start: Posture | None
    """Where the robot was at the first cycle, at rest."""
    tracks: Mapping[str, Track]
    """The parts of a cycle by the names of `Cycle`'s fields; none before the first cycle."""
    events: tuple[Event, ...]
    truncated: bool
    """Whether the log ends before its end, as one does whose program was killed."""
    lost_bytes: int
    """Bytes at the end of a truncated log that could not be read."""

    @property
    def cycles(self) -> int:
        """Return how many cycles could be read."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """Return when each cycle was measured, on the backend's clock [s], shape (T,)."""
        return self.tracks["state"]["time"] if self.tracks else np.zeros(0)

    @property
    def state(self) -> Track:
        """Return what was measured."""
        return self.tracks["state"]

    @property
    def asked(self) -> Track:
        """Return what the controller wanted."""
        return self.tracks["asked"]

    @property
    def sent(self) -> Track:
        """Return what reached the servos."""
        return self.tracks["sent"]

    def measurement(self, cycle: int) -> State:
        """Return what was measured in a cycle."""
        return State(**_row(self.state, State, cycle))

    def command(self, cycle: int) -> Command:
        """Return what reached the servos in a cycle."""
        # Logs older than this limit do not hold it: all of the supply was allowed.
        unlimited = {"pwm_limit": np.ones(len(self.joint_names))}
        return Command(**unlimited | _row(self.sent, Command, cycle))

    def describe(self) -> str:
        """Tell in one line how much there is."""
        seconds = float(self.time[-1] - self.time[0]) if self.cycles else 0.0
        told = f"{self.robot}: {self.cycles} cycles, {seconds:.2f} s, {len(self.events)} events"
        return f"{told}, cut off ({self.lost_bytes} bytes lost)" if self.truncated else told

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> FlightRecord:
        """Load a flight log, or of one that was cut off all that is whole.

        Args:
            path: File that `FlightLog` wrote.
            robot: Robot that it must be of; ``None`` for any.

        Raises:
            ValueError: one line that names the file and its fault: it is no flight log, is
                damaged, or another robot's.
        """
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ValueError(f"flight log {path}: {error.strerror or error}") from error
        if not data.startswith(MCAP0_MAGIC):
            raise ValueError(f"flight log {path}: not an MCAP file, allowed a log of FlightLog")
        try:
            record = _read(path, data)
        except DAMAGE as error:
            fault = " ".join(str(error).split())[:200] or type(error).__name__
            raise ValueError(f"flight log {path}: damaged ({fault})") from error
        if robot is not None:
            record.check_robot(robot)
        return record

    def check_robot(self, robot: Robot) -> None:
        """Refuse another robot.

        Raises:
            ValueError: saying whose log it is.
        """
        if self.robot != robot.name:
            fault = f"of robot '{self.robot}', allowed '{robot.name}'"
        elif self.joint_names != robot.joint_names:
            fault = (
                f"of a '{robot.name}' with joints {', '.join(self.joint_names)}, "
                f"allowed {', '.join(robot.joint_names)}"
            )
        else:
            return
        raise ValueError(f"flight log {self.path}: it is {fault}")


def _row(track: Track, kind: type[State] | type[Command], cycle: int) -> dict[str, Any]:
    row = {one.name: track[one.name][cycle] for one in fields(kind) if one.name in track}
    return {name: value.item() if np.ndim(value) == 0 else value for name, value in row.items()}


def _read(path: Path, data: bytes) -> FlightRecord:
    content = Content(data)
    about = content.about
    if not about:
        raise ValueError("it does not say which robot it is of")
    if about["format"] != FORMAT:
        raise ValueError(f"format is '{about['format']}', allowed '{FORMAT}'")
    names = {topic: name for name, topic in TOPICS.items()}
    joint_names = tuple(map(str, orjson.loads(about["joint_names"])))
    tracks = {
        names.get(topic, topic.strip("/")): track for topic, track in content.tracks().items()
    }
    if tracks:
        _check_tracks(tracks, len(joint_names))
    return FlightRecord(
        path=path,
        robot=about["robot"],
        joint_names=joint_names,
        period=float(about["period"]),
        started=about["started"],
        about=orjson.loads(about["about"]),
        start=_parse_posture(about["start"], joint_names),
        tracks=tracks,
        events=tuple(content.events),
        truncated=not content.is_complete,
        lost_bytes=content.lost_bytes,
    )


def _check_tracks(tracks: dict[str, Track], n: int) -> None:
    """Check that each cycle was measured, asked and sent, n joints each."""
    cycles = tracks["state"].cycle
    for name in NEEDED:
        if not np.array_equal(tracks[name].cycle, cycles):
            raise ValueError(f"not every cycle has its '{name}'")
    for name in ("state", "sent"):
        shape = tracks[name]["joint_pos"].shape
        if shape != (len(cycles), n):
            raise ValueError(f"{name} has angles of shape {shape}, allowed {(len(cycles), n)}")


def _parse_posture(text: str, joint_names: tuple[str, ...]) -> Posture | None:
    if not text:
        return None
    record = json.loads(text)
    angles = [record["joint_pos"][name] for name in joint_names]
    return Posture(
        position=np.array(record["position"], dtype=float),
        orientation=np.array(record["orientation"], dtype=float),
        joint_pos=np.array(angles, dtype=float),
    )
