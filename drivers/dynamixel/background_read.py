"""Reads the IMU and, in turns, slow values of the servos: supply, torque, watchdog, errors."""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence

import numpy as np

from drivers.dynamixel.board import Board
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.cyclic_read import MISSES
from drivers.dynamixel.protocol2 import ALERT, Span
from drivers.dynamixel.requests import Request
from drivers.dynamixel.servo_states import ERROR, SUPPLY, TORQUE, WATCHDOG, ServoStates
from robots import Joint

ROTATION = (TORQUE, WATCHDOG, SUPPLY)
"""Items that are read of every servo in turns, one item of one servo a cycle."""
POLL_BOARD_EVERY = 5  # cycles between two requests to a board that is silent
SPARE = 0.0005  # s of a cycle that a request needs beyond its bytes' time


class BackgroundRead:
    """Reads a board's IMU and one item of one of its servos in each cycle.

    Both go in one request, which spares a turnaround. Urgent items go first: the cause of an
    alert, then the torque of a servo that may have restarted.
    """

    def __init__(
        self,
        bus: DynamixelBus,
        joints: Sequence[Joint],
        rows: np.ndarray,
        board: Board | None,
    ) -> None:
        """Prepare to read joints at places in the joint order, and a board if it is here."""
        self._bus, self._board = bus, board
        self._rows = rows
        self._servos = dict(zip(rows.tolist(), (joint.servo for joint in joints), strict=True))
        self._tables = {row: table_named(s.model.name) for row, s in self._servos.items()}
        self._turns = itertools.cycle(
            (item, row)
            for item, row in itertools.product(ROTATION, self._servos)
            if item in self._tables[row]
        )
        self._cycle = 0
        self._board_misses = 0
        self._requests: dict[tuple[int, str, int, bool, bool], Request | None] = {}
        self._prepared: tuple[Request | None, int, str] = None, -1, ""
        self._open: tuple[Request, int, str] | None = None

    def prepare(self, states: ServoStates, left_out: Sequence[int]) -> None:
        """Choose and build this cycle's request, while others are on the wire.

        Ids that are left out are not read.
        """
        self._cycle += 1
        row, item = self._choose(states, left_out)
        self._prepared = self._build(row, item), row, item

    def begin(self, limit: float) -> None:
        """Send the requests that can be answered before a time of the monotonic clock [s]."""
        request, row, item = self._prepared
        self._open = None
        if row >= 0 and not has_time(self._bus, request, limit):
            row, item = -1, ""
            request = self._build(row, item)
        if request is not None and has_time(self._bus, request, limit):
            self._bus.begin(request)
            self._open = request, row, item

    def collect(self, states: ServoStates, limit: float) -> None:
        """Collect the replies: the value of the servo, and the sample of the board.

        ``limit`` is the time of the monotonic clock after which not to wait [s].
        """
        if self._open is None:
            return
        request, row, item = self._open
        self._board_misses += self._is_board_due
        for status in self._bus.collect(request, limit):
            if status.number or not status.data:
                continue
            if self._board is not None and status.id == self._board.id:
                self._board_misses = 0
                self._board.receive(status.data)
            elif item == ERROR and item not in self._tables[row]:  # the reply itself names it
                states.note_errors(row, status.alarms)
            else:
                states.update_background(row, item, status.data)

    @property
    def _is_board_due(self) -> bool:
        """Return whether to read the board; waiting for a silent one every cycle costs too much."""
        if self._board is None:
            return False
        return self._board_misses < MISSES or self._cycle % POLL_BOARD_EVERY == 0

    def _choose(self, states: ServoStates, left_out: Sequence[int]) -> tuple[int, str]:
        """Choose the servo and item to read: an urgent one, else the next in turn."""
        rows = self._rows
        for flags, item in ((states.alert == ALERT, ERROR), (states.is_unsure, TORQUE)):
            if flags.any():
                for row in rows[flags[rows]].tolist():
                    if self._servos[row].id not in left_out:
                        return row, item
        for _ in self._servos:
            item, row = next(self._turns)
            if self._servos[row].id not in left_out:
                if item == TORQUE and states.alert[row]:
                    item = ERROR  # more errors may have come
                return row, item
        return -1, ""

    def _build(self, row: int, item: str) -> Request | None:
        """Build the request to the board and to a servo; each is built once."""
        is_board_last = self._board_misses > 0
        key = (row, item, self._cycle % 2, is_board_last, self._is_board_due)
        if key not in self._requests:
            servo, board = {}, {}
            if row >= 0:
                servo = {self._servos[row].id: self._span(row, item)}
            if self._board is not None and self._is_board_due:
                board = {self._board.id: self._board.span(self._cycle)}
            # A silent board may keep the devices behind it from replying.
            spans = servo | board if is_board_last else board | servo
            self._requests[key] = self._bus.group(spans) if spans else None
        return self._requests[key]

    def _span(self, row: int, item: str) -> Span:
        """Return the registers of an item; any will do for errors that each reply names."""
        table = self._tables[row]
        if item not in table:
            item = TORQUE
        return table.span(item, "present_temperature" if item == SUPPLY else item)


def has_time(bus: DynamixelBus, request: Request | None, limit: float) -> bool:
    """Return whether a request can be answered before a time of the monotonic clock [s]."""
    return request is not None and time.monotonic() + bus.duration(request) + SPARE < limit
