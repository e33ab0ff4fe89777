"""Flight record: a flight log read back as arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from mcap.writer import MCAP0_MAGIC

from drivers.flight_log.content import DAMAGE, Content, Event, Track, explain
from drivers.flight_log.writer import FORMAT, TOPICS
from drivers.state import Command, Integers, State
from robots import Posture, Robot
from robots.quaternion import Array
from robots.storage.files import read_bounded

MOST_BYTES = 1 << 29  # of a file
NEEDED = ("state", "asked", "sent")
OF_JOINTS = {
    "state": ("joint_pos", "joint_vel", "joint_current"),
    "sent": ("joint_pos", "torque_limit"),
}
"""Fields of a number for each joint."""


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
    """Posture of the robot at the first cycle, at rest."""
    tracks: Mapping[str, Track]
    """Parts of a cycle by the names of `Cycle`'s fields; none without a cycle."""
    events: tuple[Event, ...]
    truncated: bool
    """Whether the log is incomplete, as after a kill, or damaged."""
    damage: str = ""
    """Number of damaged records, which are left out, and problem of the first; empty for none."""
    lost_bytes: int
    """Bytes that could not be read."""

    @property
    def cycles(self) -> int:
        """Return the number of cycles."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """Return the time of each cycle on the backend's clock [s], shape (T,)."""
        return self.tracks["state"]["time"] if self.tracks else np.zeros(0)

    @property
    def wall_time(self) -> Integers:
        """Return the wall time of each cycle [ns since 1970], shape (T,)."""
        return self.state.log_time if self.tracks else np.zeros(0, dtype=int)

    @property
    def state(self) -> Track:
        """Return the measurements."""
        return self.tracks["state"]

    @property
    def sent(self) -> Track:
        """Return the commands that reached the servos."""
        return self.tracks["sent"]

    def measurement(self, cycle: int) -> State:
        """Return the measurement of a cycle."""
        return State(**_row(self.state, State, cycle))

    def command(self, cycle: int) -> Command:
        """Return the command that reached the servos in a cycle."""
        return Command(**_row(self.sent, Command, cycle))

    def describe(self) -> str:
        """Summarize the record in one line."""
        seconds = float(self.time[-1] - self.time[0]) if self.cycles else 0.0
        summary = f"{self.robot}: {self.cycles} cycles, {seconds:.2f} s, {len(self.events)} events"
        if not self.truncated:
            return summary
        how = f"damaged ({self.damage})" if self.damage else "cut off"
        return f"{summary}, {how}: {self.lost_bytes} bytes lost"

    @classmethod
    def load(cls, path: Path, robot: Robot | None = None) -> FlightRecord:
        """Load a flight log of a robot, or of any.

        Of one that was cut off or is damaged, all whole chunks are read.

        Raises:
            ValueError: one line with the file and its problem: it is not a flight log, is
                damaged where it says whose it is, is too large, or another robot's.
        """
        try:
            data = read_bounded(path, MOST_BYTES)
            if not data.startswith(MCAP0_MAGIC):
                raise ValueError("not an MCAP file, expected a log of FlightLog")
        except OSError as error:
            raise ValueError(f"flight log {path}: {error.strerror or error}") from error
        except ValueError as error:
            raise ValueError(f"flight log {path}: {error}") from error
        try:
            record = _read(path, data)
        except DAMAGE as error:
            raise ValueError(f"flight log {path}: damaged ({explain(error)})") from error
        if robot is not None:
            record.check_robot(robot)
        return record

    def check_robot(self, robot: Robot) -> None:
        """Refuse the log of another robot by a `ValueError`."""
        if self.robot != robot.name:
            problem = f"of robot '{self.robot}', expected '{robot.name}'"
        elif self.joint_names != robot.joint_names:
            problem = (
                f"of a '{robot.name}' with joints {', '.join(self.joint_names)}, "
                f"expected {', '.join(robot.joint_names)}"
            )
        else:
            return
        raise ValueError(f"flight log {self.path}: it is {problem}")


def _row(track: Track, kind: type[State] | type[Command], cycle: int) -> dict[str, Any]:
    row = {one.name: track[one.name][cycle] for one in fields(kind) if one.name in track}
    return {name: value.item() if np.ndim(value) == 0 else value for name, value in row.items()}


def _read(path: Path, data: bytes) -> FlightRecord:
    content = Content(data)
    about, problems = content.about, content.problems
    damage = f"records left out: {len(problems)}, first: {problems[0]}" if problems else ""
    if not about:
        raise ValueError(damage or "it does not name its robot")
    if about["format"] != FORMAT:
        raise ValueError(f"format is '{about['format']}', expected '{FORMAT}'")
    if not about.get("joint_names"):
        raise ValueError("it does not name its joints, expected a log of FlightLog")
    names = {topic: name for name, topic in TOPICS.items()}
    joint_names = tuple(map(str, orjson.loads(about["joint_names"])))
    tracks = {
        names.get(topic, topic.strip("/")): track for topic, track in content.tracks().items()
    }
    if tracks:
        _check_tracks(tracks, len(joint_names))
    is_begun = not tracks or tracks["state"].cycle[0] == 0
    return FlightRecord(
        path=path,
        robot=about["robot"],
        joint_names=joint_names,
        period=float(about["period"]),
        started=about["started"],
        about=orjson.loads(about["about"]),
        start=_parse_posture(about["start"] if is_begun else "", joint_names),
        tracks=tracks,
        events=tuple(content.events),
        truncated=not content.is_complete or bool(damage),
        damage=damage,
        lost_bytes=content.lost_bytes,
    )


def _check_tracks(tracks: dict[str, Track], n: int) -> None:
    """Check that each cycle has a measurement and both commands, of n joints."""
    cycles = tracks["state"].cycle
    for name in NEEDED:
        if not np.array_equal(tracks[name].cycle, cycles):
            raise ValueError(f"not every cycle has its '{name}'")
    for name, field in ((name, field) for name, these in OF_JOINTS.items() for field in these):
        shape = tracks[name][field].shape
        if shape != (len(cycles), n):
            raise ValueError(f"{name} has {field} of shape {shape}, expected {(len(cycles), n)}")


def _parse_posture(text: str, joint_names: tuple[str, ...]) -> Posture | None:
    if not text:
        return None
    record = json.loads(text)
    record["joint_pos"] = [record["joint_pos"][name] for name in joint_names]
    parts = ("position", "orientation", "joint_pos")
    return Posture(**{part: np.array(record[part], dtype=float) for part in parts})
