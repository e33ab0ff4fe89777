"""One port of a robot: its servos, perhaps its board, and what each cycle asks of them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

import numpy as np

from drivers.audit import ServoFacts
from drivers.bus import Answers, DynamixelBus, Question
from drivers.control_table import ControlTable, table_named
from drivers.errors import SetupError
from drivers.group_read import GroupKind, GroupRead
from drivers.opencr import BodyImu, OpenCr
from drivers.port import PortError, PortLostError
from drivers.protocol2 import ALERT, Span, Status
from drivers.servo_bank import GROUP_BYTES, ServoBank
from drivers.servo_orders import Orders, OrderWriter
from drivers.servo_setup import ServoSetup
from robots import Joint, Robot
from robots.servo import TICKS_PER_TURN

SYNC_WRITTEN = (
    "torque_enable",
    "status_return_level",
    "position_p_gain",
    "bus_watchdog",
    "goal_pwm",
    "goal_position",
)
TRIES = 3
REOPEN_EVERY = 0.2  # s between two attempts to open a port that was lost
SLOW_ITEMS = ("torque_enable", "bus_watchdog", "present_input_voltage")
TRIPPED = 0xFF  # Bus Watchdog register: -1, the servo has stopped by itself
SETUP_STEPS = 4  # instructions to servos that are set up again, a cycle
STEP_TIME = 0.0015  # s that one of them may take
VERIFY_TRIES = 3  # reads of torque registers after a change, before the servos are doubted
POLL_WAIT = 0.0015  # s for a left-out servo's answer to a ping
SPARE = 0.0005  # s of a cycle beyond an answer's bytes without which it is not asked for


class ServoLine:
    """What hangs on one port, from the first reading to the last torque off.

    Nothing here raises for a silent servo, nor for a port that is gone: then the line
    `is_lost`, its values grow old, and it is opened again as soon as that works.
    """

    def __init__(
        self,
        bus: DynamixelBus,
        robot: Robot,
        rows: np.ndarray,
        watchdog: int,
        board: OpenCr | None,
    ) -> None:
        """Prepare a line.

        Args:
            bus: The bus behind the port.
            robot: Robot that it is part of.
            rows: Places of the line's joints in the robot's joint order.
            watchdog: Register value of the bus watchdog under torque.
            board: The controller board, if it is on this port.
        """
        self.bus, self.rows, self.board = bus, rows, board
        self.joints: list[Joint] = [robot.joints[row] for row in rows]
        self.is_lost = False
        self.eeprom_writes = 0
        self.writer = OrderWriter(bus, self.joints, rows, watchdog)
        self._ids = np.array([joint.servo.id for joint in self.joints])
        self._tables = [table_named(joint.servo.model.name) for joint in self.joints]
        _check_registers(self._tables)
        self._facts: dict[int, ServoFacts] = {}
        self._setups: dict[int, ServoSetup] = {}
        self._group: GroupRead | None = None
        self._slow = self._turn_slowly()
        self._cycle = 0
        self._reopen_at = 0.0
        self._verify_left = 0
        self._answers: Answers | None = None
        self._look: tuple[Question, int, str] | None = None
        self._looks: dict[tuple[int, str, int, bool], Question | None] = {}
        self._board_misses = 0

    # Setting up -------------------------------------------------------------------------------

    def adopt(self, servos: Mapping[int, ServoFacts]) -> None:
        """Take over what the audit found of each joint, by place in the joint order."""
        self._facts = dict(servos)
        self._group = GroupRead(
            self.bus,
            {servo.id: _group_span(servo.table) for servo in servos.values()},
            can_fast=all(servo.supports_fast_read for servo in servos.values()),
        )

    @property
    def group_kind(self) -> GroupKind | None:
        """Return how the servos are read now."""
        return self._group.kind if self._group else None

    @property
    def left_out(self) -> list[int]:
        """Return the ids that have been silent for too long to be read with the others."""
        return self._group.left_out if self._group else []

    def configure(self, row: int) -> str:
        """Set a servo's registers; return what it does not confirm, or nothing."""
        setup = ServoSetup(self._facts[row])
        setup.run(self.bus)
        self.eeprom_writes += setup.eeprom_writes
        return setup.failed

    def seed(self, row: int) -> bool:
        """Make a servo's present position its goal; tell whether it confirms."""
        table, device = self._table(row), self._id(row)
        present, goal = table["present_position"], table["goal_position"]
        told = self.bus.read(device, present.span, TRIES)
        if told is None or told.number:
            return False
        ticks = min(max(present.decode(told.data), 0), TICKS_PER_TURN - 1)
        done = self.bus.write(device, goal.address, goal.encode(ticks), TRIES)
        self.writer.forget()
        return done is not None and not done.number

    # Reading ----------------------------------------------------------------------------------

    def ask_group(self) -> None:
        """Send the question for everybody's position, velocity and current."""
        self._cycle += 1
        if self._group is None or not self._is_usable():
            return
        try:
            self._group.ask()
        except PortLostError:
            self._lose()

    def collect_group(self, limit: float) -> None:
        """Wait for the answers; they are taken over by `take_group`.

        Args:
            limit: Time of the monotonic clock after which not to wait [s].
        """
        self._answers = None
        if self.is_lost or self._group is None:
            return
        try:
            self._answers = self._group.collect(limit)
        except PortLostError:
            self._lose()

    @property
    def has_alert(self) -> bool:
        """Tell whether a servo tells an alert in the answers that came last."""
        return self._answers is not None and bool((self._answers.errors & ALERT).any())

    def take_group(self, bank: ServoBank, now: float) -> None:
        """Take over the answers.

        Args:
            bank: Where the values go.
            now: Time of the cycle on the backend's clock [s].
        """
        if self._answers is not None and len(self._answers.devices):
            bank.take(self._answers, now)
        self._answers = None

    def ask_look(self, bank: ServoBank, limit: float) -> None:
        """Ask the board for its IMU, and one servo for one of the values that change slowly."""
        self._look = None
        if self.is_lost:
            return
        row, item = self._choose_slow(bank)
        question = self._build_look(row, item)
        if row >= 0 and not self._has_time(question, limit):
            row, item = -1, ""
            question = self._build_look(row, item)
        if question is None or not self._has_time(question, limit):
            return
        self._look = question, row, item
        try:
            self.bus.ask(question)
        except PortLostError:
            self._lose()

    def take_look(self, bank: ServoBank, imu: BodyImu, now: float, limit: float) -> None:
        """Take in what `ask_look` asked for."""
        if self.is_lost or self._look is None:
            return
        question, row, item = self._look
        self._board_misses += self.board is not None
        try:
            for status in self.bus.collect(question, limit):
                if status.number or not status.data:
                    continue
                if self.board is not None and status.id == self.board.id:
                    self._board_misses = 0
                    speed = float(np.abs(bank.velocity).max())
                    imu.take(self.board.decode(status.data), now, speed)
                else:
                    self._take_slow(bank, row, item, status)
        except PortLostError:
            self._lose()

    def tend(self, bank: ServoBank, limit: float) -> None:
        """Do what is left of a cycle's reading: verify torque, find lost servos, set up again."""
        if self.is_lost or self._group is None:
            return
        try:
            if self._verify_left:
                self._verify_torque(bank, limit)
            self._poll(bank, limit)
            self._set_up_again(bank, limit)
        except PortLostError:
            self._lose()

    # Writing ----------------------------------------------------------------------------------

    def write(self, orders: Orders, bank: ServoBank, fresh: np.ndarray) -> None:
        """Send everybody's orders."""
        if self.is_lost:
            return
        was_on = bank.is_on[self.rows]
        try:
            self.writer.write(orders, bank, fresh)
        except PortLostError:
            self._lose()
            return
        if not np.array_equal(bank.is_on[self.rows], was_on):
            self._verify_left = VERIFY_TRIES

    def note_loss(self, bank: ServoBank) -> None:
        """Bring the flags of a lost line's servos up to date."""
        if self.is_lost:
            bank.note_lost_port(self.rows)
            self._setups.clear()

    # Letting go -------------------------------------------------------------------------------

    def release(self) -> list[Joint]:
        """Take torque and watchdog off everywhere; return the joints that do not confirm it."""
        self._reopen_at = 0.0
        if not self._is_usable() or not self.bus.port.is_open:
            return list(self.joints)
        try:
            for _ in range(2):  # nobody confirms these
                self.writer.release_all()
            self.writer.disarm_all()
            return [joint for joint in self.joints if not self._is_released(joint)]
        except PortLostError:
            self.is_lost = True
            return list(self.joints)

    def disarm(self) -> None:
        """Take the watchdogs off, so that the servos hold for as long as they have power."""
        if not self.is_lost and self.bus.port.is_open:
            try:
                self.writer.disarm_all()
                self.writer.disarm_all()
            except PortLostError:
                self.is_lost = True

    def _is_released(self, joint: Joint) -> bool:
        torque = table_named(joint.servo.model.name)["torque_enable"]
        told = self.bus.read(joint.servo.id, torque.span)
        if told is not None and told.data == b"\x00":
            return True
        done = self.bus.write(joint.servo.id, torque.address, b"\x00", 2)
        return done is not None and not done.number

    # The port ---------------------------------------------------------------------------------

    def _lose(self) -> None:
        self.is_lost = True
        self._look = self._answers = None
        self.bus.port.close()
        self._reopen_at = time.monotonic() + REOPEN_EVERY

    def _is_usable(self) -> bool:
        """Tell whether the port is there; open it again if it was lost."""
        if not self.is_lost:
            return True
        if time.monotonic() < self._reopen_at:
            return False
        try:
            self.bus.port.open()
            self.is_lost = False
            self.writer.release_all()
            self.writer.forget()
        except PortError:
            self._lose()
        return not self.is_lost

    # Slow values ------------------------------------------------------------------------------

    def _turn_slowly(self) -> Iterator[tuple[int, str]]:
        while True:
            for item in SLOW_ITEMS:
                for row in self.rows:
                    yield int(row), item

    def _build_look(self, row: int, item: str) -> Question | None:
        """Build the question to the board and to a servo; the same ones come round again."""
        is_board_last = self._board_misses > 0
        key = (row, item, self._cycle % 2, is_board_last)
        if key not in self._looks:
            servo = {self._id(row): self._slow_span(item)} if row >= 0 else {}
            board = {self.board.id: self.board.span(self._cycle)} if self.board else {}
            # A board that is silent may keep from answering who comes behind it.
            spans = servo | board if is_board_last else board | servo
            self._looks[key] = Question.group(spans) if spans else None
        return self._looks[key]

    def _choose_slow(self, bank: ServoBank) -> tuple[int, str]:
        """Choose whom to ask for what: what is urgent, else whose turn it is."""
        out = self.left_out
        rows = self.rows
        if bank.alert.any():
            for row in rows[bank.alert[rows] == ALERT]:
                if self._id(row) not in out:
                    return int(row), "hardware_error_status"
        if bank.is_unsure.any():
            for row in rows[bank.is_unsure[rows]]:
                if self._id(row) not in out:
                    return int(row), "torque_enable"
        for _ in rows:
            row, item = next(self._slow)
            if self._id(row) not in out:
                if item == "torque_enable" and bank.alert[row]:
                    item = "hardware_error_status"  # more may have come
                return row, item
        return -1, ""

    def _take_slow(self, bank: ServoBank, row: int, item: str, status: Status) -> None:
        data = status.data
        if item == "torque_enable":
            bank.take_torque(row, data[0])
        elif item == "bus_watchdog":
            bank.must_seed[row] |= data[0] == TRIPPED and bool(bank.is_on[row])
        elif item == "hardware_error_status":
            bank.alert[row] = data[0] or ALERT
        else:
            table = self._table(row)
            bank.voltage[row] = int.from_bytes(data[:2], "little") * table[item].scale
            bank.temperature[row] = data[2]

    def _slow_span(self, item: str) -> Span:
        table = self._tables[0]
        if item == "present_input_voltage":
            return table.span(item, "present_temperature")
        return table[item].span

    # Servos that need care --------------------------------------------------------------------

    def _verify_torque(self, bank: ServoBank, limit: float) -> None:
        """Read back the torque registers that nobody confirmed when they were written."""
        out = self.left_out
        span = self._tables[0]["torque_enable"].span
        spans = {int(i): span for i in self._ids if i not in out}
        if not spans:
            return
        fast = self.group_kind is GroupKind.FAST and len(spans) > 1
        question = Question.group(spans, fast=fast)
        if not self._has_time(question, limit):
            return
        self.bus.ask(question)
        told = self.bus.collect_group(question, limit)
        self._verify_left -= 1
        rows = np.array([bank.row(int(device)) for device in told.devices], dtype=int)
        is_on = told.data[:, 0] == 1
        bank.must_release[rows[is_on & ~bank.is_on[rows]]] = True
        off = rows[~is_on & bank.is_on[rows]]
        if self._verify_left > 0:
            bank.must_seed[off] = True  # the order was lost: it is given again
        else:
            bank.is_unsure[off] = True
        if len(told.devices) == len(spans) and np.array_equal(is_on, bank.is_on[rows]):
            self._verify_left = 0

    def _poll(self, bank: ServoBank, limit: float) -> None:
        """Look whether a servo that was left out is back."""
        if not self.left_out or self._group is None:
            return
        limit = min(limit, time.monotonic() + POLL_WAIT + self.bus.answer_margin)
        if time.monotonic() + POLL_WAIT > limit:
            return
        device = self._group.due_poll()
        if device is None:
            return
        row = bank.row(device)
        question = Question.group({device: self._table(row)["torque_enable"].span})
        self.bus.ask(question)
        for _ in self.bus.collect(question, limit):
            self._group.restore(device)
            if not bank.is_on[row]:
                bank.note_restart(row)

    def _set_up_again(self, bank: ServoBank, limit: float) -> None:
        """Bring servos that may have restarted to where they may have torque again."""
        if bank.is_ready.all():
            return
        out, steps = self.left_out, 0
        for row in self.rows[~bank.is_ready[self.rows] & (bank.alert[self.rows] == 0)]:
            if self._id(row) in out or row not in self._facts:
                continue
            setup = self._setups.setdefault(int(row), ServoSetup(self._facts[row], recheck=True))
            while not setup.done:
                if steps == SETUP_STEPS or time.monotonic() + STEP_TIME > limit:
                    return
                steps += 1
                if not setup.step(self.bus):
                    break
            if setup.done:
                self.eeprom_writes += setup.eeprom_writes
                del self._setups[int(row)]
                bank.note_ready(int(row))
                self.writer.forget()

    # Small helpers ----------------------------------------------------------------------------

    def _id(self, row: int | np.integer) -> int:
        return int(self._ids[np.searchsorted(self.rows, row)])

    def _table(self, row: int) -> ControlTable:
        return self._tables[int(np.searchsorted(self.rows, row))]

    def _has_time(self, question: Question | None, limit: float) -> bool:
        if question is None:
            return False
        return time.monotonic() + self.bus.duration(question) + SPARE < limit


def _check_registers(tables: list[ControlTable]) -> None:
    """Refuse servos that cannot be written to together."""
    for name in SYNC_WRITTEN:
        if len({(table[name].address, table[name].size) for table in tables}) > 1:
            models = ", ".join(sorted({table.model for table in tables}))
            raise SetupError(f"servos {models} keep {name} in different places: give each a port")


def _group_span(table: ControlTable) -> Span:
    """Return the registers of current (or load), velocity and position."""
    first = "present_current" if "present_current" in table else "present_load"
    span = table.span(first, "present_position")
    assert span.length == GROUP_BYTES
    return span
