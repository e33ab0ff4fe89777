"""What a control cycle costs on a servo bus: bytes, and the time that its reading takes."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers import protocol2
from drivers.audit import ServoFacts
from drivers.bus import DynamixelBus, Question
from drivers.control_table import ControlTable
from drivers.group_read import GroupRead
from drivers.opencr import OpenCr
from drivers.protocol2 import Span

ROUNDS = 50  # readings whose time is taken
GOAL_BYTES = 4


@dataclass(frozen=True, kw_only=True)
class Latency:
    """How long a cycle's reading takes, measured [s]."""

    rounds: int
    kind: str
    """How the group was read: fast sync read, sync read or bulk read."""
    group_median: float
    """One group read: everybody's current, velocity and position."""
    group_p99: float
    reading_median: float
    """All that a cycle reads: the group, then the IMU and one slow value."""
    reading_p99: float
    lost: int
    """Answers that did not come."""
    damaged: int
    """Answers whose CRC did not match."""


class CycleReading:
    """The questions of one cycle to the servos and the board of one bus."""

    def __init__(
        self, bus: DynamixelBus, servos: Sequence[ServoFacts], board: OpenCr | None
    ) -> None:
        """Prepare to read.

        Args:
            bus: Where they are.
            servos: Those that answer, at least one.
            board: The board, if it is on this bus and answers.
        """
        self._bus, self._servos = bus, servos
        self._spans = {servo.id: group_span(servo.table) for servo in servos}
        self._can_fast = all(servo.supports_fast_read for servo in servos)
        slow = servos[0].table.span("present_input_voltage", "present_temperature")
        look = {servos[0].id: slow}
        if board is not None:
            look = {board.id: board.span(0)} | look
        self._look = Question.group(look)

    @property
    def bytes(self) -> int:
        """Return the bytes of one cycle on the wire, both ways, goals included."""
        group = Question.group(self._spans, fast=self._can_fast)
        goal = self._servos[0].table["goal_position"].address
        goals = protocol2.sync_write(goal, {servo.id: bytes(GOAL_BYTES) for servo in self._servos})
        asked = (group, self._look)
        return sum(len(q.frame) + q.answer_size for q in asked) + len(goals)

    def measure(self, rounds: int = ROUNDS) -> Latency:
        """Read as a cycle does, again and again, and take the time."""
        bus = self._bus
        group = GroupRead(bus, self._spans, can_fast=self._can_fast)
        kind, lost, damaged = group.kind.value, bus.statistics.lost, bus.statistics.damaged
        times = np.zeros((rounds, 2))
        for row in times:
            start = time.monotonic()
            group.ask()
            group.collect(math.inf)
            row[0] = time.monotonic() - start
            bus.put(self._look)
            row[1] = time.monotonic() - start
        medians, p99s = np.percentile(times, (50, 99), axis=0)
        return Latency(
            rounds=rounds,
            kind=kind,
            group_median=float(medians[0]),
            group_p99=float(p99s[0]),
            reading_median=float(medians[1]),
            reading_p99=float(p99s[1]),
            lost=bus.statistics.lost - lost,
            damaged=bus.statistics.damaged - damaged,
        )


def group_span(table: ControlTable) -> Span:
    """Return the registers of current (or load), velocity and position."""
    first = "present_current" if "present_current" in table else "present_load"
    return table.span(first, "present_position")
