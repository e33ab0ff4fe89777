"""The second question of every cycle: the IMU, and one slow value of one servo."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np

from drivers.dynamixel.bus import DynamixelBus, Request
from drivers.dynamixel.control_table import ControlTable
from drivers.dynamixel.cyclic_read import MISSES
from drivers.dynamixel.opencr import BodyImu, OpenCr
from drivers.dynamixel.protocol2 import ALERT, Span, Status
from drivers.dynamixel.servo_states import ServoStates

TORQUE, WATCHDOG, SUPPLY = "torque_enable", "bus_watchdog", "present_input_voltage"
ERROR = "hardware_error_status"
TURNS = (TORQUE, WATCHDOG, SUPPLY)
"""What every servo is asked for in turn, one item of one servo a cycle."""
TRIPPED = 0xFF  # Bus Watchdog register: -1, the servo has stopped by itself
POLL_BOARD_EVERY = 5  # cycles between two questions to a board that is silent
SPARE = 0.0005  # s of a cycle beyond an answer's bytes without which it is not asked for


class BackgroundRead:
    """Asks a line's board for its IMU and one of its servos for what changes slowly.

    Both go in one question, which spares a turn-round. What is urgent goes first: the cause of
    an alert, then the torque of a servo that may have restarted.
    """

    def __init__(
        self,
        bus: DynamixelBus,
        rows: np.ndarray,
        ids: Sequence[int],
        tables: Sequence[ControlTable],
        board: OpenCr | None,
    ) -> None:
        """Prepare to look.

        Args:
            bus: Where the devices are.
            rows: Places of the servos' joints in the robot's joint order.
            ids: The servos' ids.
            tables: Their registers.
            board: The controller board, if it is on this bus.
        """
        self._bus, self._board = bus, board
        self._rows = rows
        self._ids = dict(zip(rows.tolist(), ids, strict=True))
        self._tables = dict(zip(rows.tolist(), tables, strict=True))
        self._turns = self._take_turns()
        self._cycle = 0
        self._board_misses = 0
        self._questions: dict[tuple[int, str, int, bool, bool], Request | None] = {}
        self._prepared: tuple[Request | None, int, str] = None, -1, ""
        self._open: tuple[Request, int, str] | None = None

    def prepare(self, bank: ServoStates, left_out: Sequence[int]) -> None:
        """Choose and build this cycle's question, while others are on the wire.

        Args:
            bank: What is known of the servos.
            left_out: Ids that are not to be asked.
        """
        self._cycle += 1
        row, item = self._choose(bank, left_out)
        self._prepared = self._build(row, item), row, item

    def ask(self, limit: float) -> None:
        """Send the question, as far as there is time for the answers.

        Args:
            limit: Time of the monotonic clock after which not to wait [s].
        """
        question, row, item = self._prepared
        self._open = None
        if row >= 0 and not has_time(self._bus, question, limit):
            row, item = -1, ""
            question = self._build(row, item)
        if question is not None and has_time(self._bus, question, limit):
            self._bus.ask(question)
            self._open = question, row, item

    def take(self, bank: ServoStates, imu: BodyImu, now: float, limit: float) -> None:
        """Take in the answers.

        Args:
            bank: Where a servo's value goes.
            imu: Where the IMU's go.
            now: Time of the cycle on the backend's clock [s].
            limit: Time of the monotonic clock after which not to wait [s].
        """
        if self._open is None:
            return
        question, row, item = self._open
        self._open = None
        self._board_misses += self._is_board_due
        for status in self._bus.collect(question, limit):
            if status.number or not status.data:
                continue
            if self._board is not None and status.id == self._board.id:
                self._board_misses = 0
                speed = float(np.abs(bank.velocity).max())
                imu.take(self._board.decode(status.data), now, speed)
            else:
                self._take_value(bank, row, item, status)

    def forget(self) -> None:
        """Forget the open question: the port is gone."""
        self._open = None

    def _take_turns(self) -> Iterator[tuple[int, str]]:
        while True:
            for item in TURNS:
                for row in self._ids:
                    yield row, item

    @property
    def _is_board_due(self) -> bool:
        """Tell whether to ask the board; waiting for a silent one in every cycle costs too much."""
        if self._board is None:
            return False
        return self._board_misses < MISSES or self._cycle % POLL_BOARD_EVERY == 0

    def _choose(self, bank: ServoStates, left_out: Sequence[int]) -> tuple[int, str]:
        """Choose whom to ask for what: what is urgent, else whose turn it is."""
        rows = self._rows
        for flags, item in ((bank.alert == ALERT, ERROR), (bank.is_unsure, TORQUE)):
            if flags.any():
                for row in rows[flags[rows]].tolist():
                    if self._ids[row] not in left_out:
                        return row, item
        for _ in self._ids:
            row, item = next(self._turns)
            if self._ids[row] not in left_out:
                if item == TORQUE and bank.alert[row]:
                    item = ERROR  # more may have come
                return row, item
        return -1, ""

    def _build(self, row: int, item: str) -> Request | None:
        """Build the question to the board and to a servo; the same ones come round again."""
        is_board_last = self._board_misses > 0
        key = (row, item, self._cycle % 2, is_board_last, self._is_board_due)
        if key not in self._questions:
            servo = {self._ids[row]: self._span(row, item)} if row >= 0 else {}
            board = {}
            if self._board is not None and self._is_board_due:
                board = {self._board.id: self._board.span(self._cycle)}
            # A board that is silent may keep from answering who comes behind it.
            spans = servo | board if is_board_last else board | servo
            self._questions[key] = Request.group(spans) if spans else None
        return self._questions[key]

    def _span(self, row: int, item: str) -> Span:
        table = self._tables[row]
        return table.span(SUPPLY, "present_temperature") if item == SUPPLY else table[item].span

    def _take_value(self, bank: ServoStates, row: int, item: str, status: Status) -> None:
        data = status.data
        if item == TORQUE:
            bank.take_torque(row, data[0])
        elif item == WATCHDOG:
            bank.must_seed[row] |= data[0] == TRIPPED and bool(bank.is_on[row])
        elif item == ERROR:
            bank.alert[row] = data[0] or ALERT
        else:
            scale = self._tables[row][SUPPLY].scale
            bank.voltage[row] = int.from_bytes(data[:2], "little") * scale
            bank.temperature[row] = data[2]


def has_time(bus: DynamixelBus, question: Request | None, limit: float) -> bool:
    """Tell whether a question can be answered before a time of the monotonic clock [s]."""
    return question is not None and time.monotonic() + bus.duration(question) + SPARE < limit
