"""Flight log: measurement, requested and sent command of every cycle, on disk."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO, Self

import numpy as np
import orjson
from mcap.writer import Writer

from drivers.control_loop import Cycle
from drivers.flight_log.foxglove import SCHEMAS, SECOND, FoxgloveMessages
from robots import Posture, Robot
from robots.description.posture_file import format_posture

FORMAT = "1"
METADATA = "flight"
"""Name of the metadata record."""
TOPICS = {"asked": "/command_asked", "sent": "/command_sent"}
"""Topics of the parts of a cycle that differ from their field's name."""
OPTIONAL = ("guidance",)
"""Parts that not every cycle has."""
EVENT = "/event"
REST = "/cycle"
"""Topic of the other fields of a cycle."""

# A chunk of 64 KiB takes 0.4 to 0.8 ms to compress and write; one of 256 KiB would make the
# log a tenth smaller, but delay its cycle by more than a millisecond.
CHUNK_TIME = 0.25  # s of wall time
CHUNK_BYTES = 1 << 16
MOST_NS = (1 << 63) - 1  # that arrays can count to
UNBOUNDED = 1 << 40  # bytes; chunks end between cycles only, so that a cut log holds whole ones


class FlightLog:
    """Writes a flight log: an MCAP file that Foxglove opens and `FlightRecord.load` reads.

    Each part of a cycle has its topic (``/state``, ``/command_asked``, ``/command_sent``,
    and one for each further field of `Cycle` that is a dataclass) and each field of a part
    its key, so new fields are recorded automatically. Messages are JSON: floats are read back
    exactly, except that infinity becomes NaN. A message's sequence number is its cycle. Its log
    time is wall time: that of the start, and what the backend's clock has counted since the first
    cycle. Beside these, a cycle has the messages of `FoxgloveMessages`.

    The log must survive its program. So it is written under its own name from the start, in
    whole chunks: after a kill all is readable but the last quarter of a second (a power cut
    may lose more). Nothing is overwritten: an existing file is renamed to ``NAME.1``, or the
    next free number.

    A full disk must not make a robot fall: recording stops, and ``fault`` gives the reason. The
    file stays with the cycles that are on disk; without any it is removed. Not thread-safe.
    """

    def __init__(
        self,
        path: Path,
        robot: Robot,
        *,
        about: Mapping[str, str | float | int] | None = None,
        start: Posture | None = None,
    ) -> None:
        """Prepare a log; entering it creates the file.

        Args:
            path: File to write.
            robot: Robot whose cycles are logged.
            about: Further facts of the flight: scene, seed, motion...
            start: Posture of the robot at the first cycle, at rest, if known.
        """
        self.path, self._robot = path, robot
        self._about, self._start = dict(about or {}), start
        self._file: BinaryIO | None = None
        self._writer: Writer | None = None
        self._channels: dict[str, int] = {}
        self._parts: list[str] = []
        self._rest: list[str] = []
        self.cycles = 0
        """Number of logged cycles."""
        self._saved = 0  # of them on disk
        self.fault: str | None = None
        """Reason why recording stopped early, with the recorded part; None if it did not."""
        self._foxglove = FoxgloveMessages(robot)
        self._start_ns = self._time_ns = self._pending = 0
        self._first: float | None = None  # time on the backend's clock
        self._time = self._flushed_at = 0.0

    def __enter__(self) -> Self:
        """Create the file; raises `OSError` if that fails."""
        make_room(self.path)
        self._file = self.path.open("wb")
        self._writer = Writer(self._file, chunk_size=UNBOUNDED, enable_data_crcs=True)
        self._start_ns = self._time_ns = time.time_ns()
        self._writer.start(library="humanoid-getup")
        self._writer.add_metadata(METADATA, self._describe())
        self._flush()
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Close; an exception is logged as the last event."""
        if error is not None:
            self.event(self._time, "exception", f"{type(error).__name__}: {error}".rstrip(": "))
        self.close()

    def log(self, cycle: Cycle) -> None:
        """Record a cycle; an ``on_cycle`` of `drivers.run`."""
        self._set_time(cycle.state.time)
        if not self.cycles:
            values = {field.name: getattr(cycle, field.name) for field in fields(cycle)}
            parts = [name for name, value in values.items() if is_dataclass(value)]
            self._parts = list(dict.fromkeys([*parts, *OPTIONAL]))
            self._rest = [name for name in values if name not in self._parts]
        for name in self._parts:
            if (part := getattr(cycle, name)) is not None:
                self._write(TOPICS.get(name, f"/{name}"), part)
        if self._rest:
            self._write(REST, {name: getattr(cycle, name) for name in self._rest})
        for topic, message in self._foxglove.describe(cycle, self._time_ns):
            self._write(topic, message)
        self.cycles += 1
        is_due = time.monotonic() - self._flushed_at >= CHUNK_TIME
        if is_due or self._pending >= CHUNK_BYTES:
            self._flush()

    def event(self, time: float, kind: str, text: str) -> None:
        """Record a rare event at a time on the backend's clock [s], and write it to disk at once.

        ``kind`` is one word: "fault", "alert", "phase"...; ``text`` is one line.
        """
        self._set_time(time)
        self._write(EVENT, {"time": float(time), "kind": _clean(kind), "text": _clean(text)})
        self._flush()

    def close(self) -> None:
        """Finish the file; harmless if it is closed."""
        with self._stopping_on_errors():
            if self._writer and self._file:
                self._writer.finish()
                self._file.close()
        self._writer = self._file = None

    def _describe(self) -> dict[str, str]:
        robot, start = self._robot, self._start
        return {
            "format": FORMAT,
            "robot": robot.name,
            "joint_names": _to_json(robot.joint_names).decode(),
            "period": repr(robot.control_period),
            "started": datetime.fromtimestamp(self._start_ns // SECOND, UTC).isoformat(),
            "about": _to_json(self._about).decode(),
            "start": format_posture(start, robot) if start else "",
        }

    def _set_time(self, time: float) -> None:
        # MCAP counts whole nanoseconds since 1970; an invalid time repeats the last one.
        if not math.isfinite(time):
            return
        self._first = time if self._first is None else self._first
        time_ns = self._start_ns + round((time - self._first) * SECOND)
        if 0 <= time_ns <= MOST_NS:
            self._time, self._time_ns = time, time_ns

    def _write(self, topic: str, value: Any) -> None:
        if self._writer is None:
            return
        data = _to_json(value)
        with self._stopping_on_errors():
            channel = self._channels.get(topic) or self._open_channel(topic, value, data)
            self._writer.add_message(channel, self._time_ns, data, self._time_ns, self.cycles)
        self._pending += len(data)

    def _open_channel(self, topic: str, value: Any, data: bytes) -> int:
        assert self._writer
        title = type(value).__name__ if is_dataclass(value) else topic.strip("/")
        schema = SCHEMAS.get(topic) or {"title": title} | _describe_json(orjson.loads(data))
        identity = self._writer.register_schema(schema["title"], "jsonschema", orjson.dumps(schema))
        self._channels[topic] = self._writer.register_channel(topic, "json", identity)
        return self._channels[topic]

    def _flush(self) -> None:
        with self._stopping_on_errors():
            if self._writer:
                self._writer.flush()
                self._saved = self.cycles
        self._pending, self._flushed_at = 0, time.monotonic()

    @contextmanager
    def _stopping_on_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            # More than were saved may be on disk: a chunk that is whole but for its index.
            some = f"at least its first {self._saved} cycles can be replayed"
            kept, reason = some if self._saved else "removed", error.strerror or error
            self.fault = f"flight log {self.path}: {reason}, recording stopped; {kept}"
            with suppress(OSError):  # closing tries to write the rest
                if self._file:
                    self._file.close()
            with suppress(OSError):
                if not self._saved:
                    self.path.unlink()
            self._writer = self._file = None


def make_room(path: Path) -> None:
    """Rename an existing log to the next free number."""
    if path.is_file() or path.is_symlink():
        numbered = (path.with_name(f"{path.name}.{number}") for number in itertools.count(1))
        path.rename(next(free for free in numbered if not free.exists()))


def _to_json(value: Any) -> bytes:
    return orjson.dumps(value, default=_plain, option=orjson.OPT_SERIALIZE_NUMPY)


def _plain(value: Any) -> Any:
    """Convert values unknown to orjson: non-contiguous arrays, and others by their repr."""
    return value.tolist() if isinstance(value, np.ndarray) else repr(value)


def _clean(text: str) -> str:
    """Replace characters that UTF-8 cannot encode, such as a file name's invalid bytes."""
    return text.encode("utf-8", "replace").decode()


def _describe_json(value: Any) -> dict[str, Any]:
    """Describe a JSON value in JSON Schema; null stands for NaN."""
    if isinstance(value, dict):
        return {
            "type": "object",
            "properties": {key: _describe_json(item) for key, item in value.items()},
        }
    if isinstance(value, list):
        return {"type": "array", "items": _describe_json(value[0] if value else None)}
    if isinstance(value, str):
        return {"type": "string"}
    return {"type": "boolean"} if isinstance(value, bool) else {"type": "number"}
