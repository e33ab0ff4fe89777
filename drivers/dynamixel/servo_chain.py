"""One port of a robot: its servos, perhaps its board, and what each cycle asks of them."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

from drivers.dynamixel.background_read import BackgroundRead, has_time
from drivers.dynamixel.bus import DynamixelBus, Replies, Request
from drivers.dynamixel.command_writer import CommandWriter, RegisterCommands
from drivers.dynamixel.configuration import ServoSetup
from drivers.dynamixel.control_table import ControlTable, table_named
from drivers.dynamixel.cyclic_read import CyclicRead, GroupKind
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.opencr import BodyImu, OpenCr
from drivers.dynamixel.port import PortError, PortLostError
from drivers.dynamixel.protocol2 import ALERT, Span
from drivers.dynamixel.servo_states import GROUP_BYTES, ServoStates
from drivers.errors import SetupError
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
MUTE_TIME = 1.0  # s without a single byte after which a port is opened anew
SETUP_STEPS = 4  # instructions to servos that are set up again, a cycle
STEP_TIME = 0.0015  # s that one of them may take
VERIFY_TRIES = 3  # reads of torque registers after a change, before the servos are doubted
POLL_WAIT = 0.0015  # s for a left-out servo's answer to a ping


class ServoChain:
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
        self.writer = CommandWriter(bus, self.joints, rows, watchdog)
        self._ids = np.array([joint.servo.id for joint in self.joints])
        self._tables = [table_named(joint.servo.model.name) for joint in self.joints]
        _check_registers(self._tables)
        self._facts: dict[int, ServoFacts] = {}
        self._setups: dict[int, ServoSetup] = {}
        self._group: CyclicRead | None = None
        self._look = BackgroundRead(bus, rows, self._ids.tolist(), self._tables, board)
        self._cycle = 0
        self._reopen_at = 0.0
        self._heard, self._heard_at = -1, 0.0
        self._verify_left = 0
        self._answers: Replies | None = None

    @property
    def places(self) -> list[tuple[Joint, int]]:
        """Return the line's joints with their places in the robot's joint order."""
        return list(zip(self.joints, self.rows.tolist(), strict=True))

    # Setting up -------------------------------------------------------------------------------

    def adopt(self, servos: Mapping[int, ServoFacts]) -> None:
        """Take over what the audit found of each joint, by place in the joint order."""
        self._facts = dict(servos)
        self._group = CyclicRead(
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
        if self._is_mute():
            self._lose()  # for a cycle at least, in which everybody hears of it
        elif self._group is not None and self._is_usable():
            self._ask(self._group)

    def _ask(self, group: CyclicRead) -> None:
        try:
            group.ask()
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

    def take_group(self, bank: ServoStates, now: float) -> None:
        """Take over the answers.

        Args:
            bank: Where the values go.
            now: Time of the cycle on the backend's clock [s].
        """
        if self._answers is not None and len(self._answers.devices):
            bank.take(self._answers, now)
        self._answers = None

    def prepare_look(self, bank: ServoStates) -> None:
        """Choose which servo is asked for which of the values that change slowly."""
        if not self.is_lost:
            self._look.prepare(bank, self.left_out)

    def ask_look(self, limit: float) -> None:
        """Ask the board for its IMU, and one servo for what `prepare_look` chose."""
        if self.is_lost:
            return
        try:
            self._look.ask(limit)
        except PortLostError:
            self._lose()

    def take_look(self, bank: ServoStates, imu: BodyImu, now: float, limit: float) -> None:
        """Take in what `ask_look` asked for."""
        if self.is_lost:
            return
        try:
            self._look.take(bank, imu, now, limit)
        except PortLostError:
            self._lose()

    def tend(self, bank: ServoStates, limit: float) -> None:
        """Do what is left of a cycle's reading: verify torque, find lost servos, set up again."""
        if self.is_lost or self._group is None:
            return
        self.bus.limit = limit
        try:
            if self._verify_left:
                self._verify_torque(bank, limit)
            self._poll(bank, limit)
            self._set_up_again(bank, limit)
        except PortLostError:
            self._lose()
        finally:
            self.bus.limit = np.inf

    # Writing ----------------------------------------------------------------------------------

    def write(self, orders: RegisterCommands, bank: ServoStates, fresh: np.ndarray) -> None:
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

    def note_loss(self, bank: ServoStates) -> None:
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
        self._answers = None
        self._look.forget()
        self.bus.port.close()
        self._reopen_at = time.monotonic() + REOPEN_EVERY

    def _is_mute(self) -> bool:
        """Tell whether nothing at all has come from the port for long.

        Whoever else opens a port may change its speed, and some adapters hang: to open it
        anew is all that can be done from here.
        """
        heard, now = self.bus.statistics.bytes_in, time.monotonic()
        if heard != self._heard or self.is_lost:
            self._heard, self._heard_at = heard, now
        return now - self._heard_at > MUTE_TIME

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

    # Servos that need care --------------------------------------------------------------------

    def _verify_torque(self, bank: ServoStates, limit: float) -> None:
        """Read back the torque registers that nobody confirmed when they were written."""
        out = self.left_out
        span = self._tables[0]["torque_enable"].span
        spans = {int(i): span for i in self._ids if i not in out}
        if not spans:
            return
        fast = self.group_kind is GroupKind.FAST and len(spans) > 1
        question = Request.group(spans, fast=fast)
        if not has_time(self.bus, question, limit):
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

    def _poll(self, bank: ServoStates, limit: float) -> None:
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
        question = Request.group({device: self._table(row)["torque_enable"].span})
        self.bus.ask(question)
        for _ in self.bus.collect(question, limit):
            self._group.restore(device)
            if not bank.is_on[row]:
                bank.note_restart(row)

    def _set_up_again(self, bank: ServoStates, limit: float) -> None:
        """Bring servos that may have restarted to where they may have torque again."""
        if bank.is_ready.all():
            return
        out, steps = self.left_out, 0
        waiting = self.rows[~bank.is_ready[self.rows] & (bank.alert[self.rows] == 0)]
        # Another one begins in each cycle, should one of them not get on.
        for row in np.roll(waiting, self._cycle).tolist():
            if self._id(row) in out or row not in self._facts:
                continue
            setup = self._setups.setdefault(row, ServoSetup(self._facts[row], recheck=True))
            while not setup.done:
                if steps == SETUP_STEPS or time.monotonic() + STEP_TIME > limit:
                    return
                steps += 1
                if not setup.step(self.bus):
                    return
            self.eeprom_writes += setup.eeprom_writes
            del self._setups[row]
            bank.note_ready(row)
            self.writer.forget()

    # Small helpers ----------------------------------------------------------------------------

    def _id(self, row: int | np.integer) -> int:
        return int(self._ids[np.searchsorted(self.rows, row)])

    def _table(self, row: int) -> ControlTable:
        return self._tables[int(np.searchsorted(self.rows, row))]


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
