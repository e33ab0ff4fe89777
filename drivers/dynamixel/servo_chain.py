"""All servos behind one port, and the board if it is there: reads and writes of each cycle."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import ParamSpec, TypeVar

import numpy as np

from drivers.dynamixel.board import Board
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.command_writer import CommandWriter, RegisterCommands
from drivers.dynamixel.configuration import ServoSetup, goal_range
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.cyclic_read import MISSES, CyclicRead, GroupKind
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.protocol2 import ALERT, Span
from drivers.dynamixel.requests import Replies, Request
from drivers.dynamixel.robot_ports import RobotPort
from drivers.dynamixel.servo_states import ERROR, SUPPLY, TORQUE, WATCHDOG, ServoStates
from drivers.serial_port import REOPEN_EVERY, PortError, PortLostError
from robots import Joint, Robot
from robots.servo import LimitMode

MUTE_TIME = 1.0  # s without a single byte after which a port is opened again
SETUP_STEPS = 4  # instructions per cycle to servos that are set up again
STEP_TIME = 0.0015  # s that one of them may take
VERIFY_TRIES = 3  # reads of torque registers after a change, before the servos are doubted
POLL_WAIT = 0.0015  # s for the reply of a left-out servo
ROTATION = (TORQUE, WATCHDOG, SUPPLY)
"""Items that are read of every servo in turns, one item of one servo a cycle."""
POLL_BOARD_EVERY = 5  # cycles between two requests to a board that is silent
SPARE = 0.0005  # s of a cycle that a request needs beyond its bytes' time

P = ParamSpec("P")
T = TypeVar("T")


class ServoChain:
    """Servos and board on one port, from the first read to the last torque off.

    Nothing here raises for a silent servo or a lost port: then the chain `is_lost`, its values
    grow old, and the port is opened again as soon as that works.
    """

    cyclic: CyclicRead
    """Reads position, velocity and current, of the servos that `set_facts` names."""

    def __init__(self, port: RobotPort, robot: Robot, watchdog: int, limit_by: LimitMode) -> None:
        """Prepare the chain of a robot's port.

        ``watchdog`` is the register value of the bus watchdog under torque, and ``limit_by`` what
        the servos' torque limits act on.
        """
        self.name, self.bus, self.joints, board = port.name, port.bus, port.joints, port.board
        self.board = board
        self.rows = np.array([robot.joint_names.index(joint.name) for joint in self.joints])
        """Places of the joints in the robot's joint order."""
        self.is_lost = False
        self.eeprom_writes = 0
        self.writer = CommandWriter(self.bus, self.joints, self.rows, watchdog, limit_by)
        self._limit_by: LimitMode = limit_by
        self.is_watched = table_named(self.joints[0].servo.model.name).has_watchdog
        """Whether the servos stop by themselves when they are sent nothing."""
        self._torque = table_named(self.joints[0].servo.model.name)[TORQUE]
        self._facts: dict[int, ServoFacts] = {}
        self._setups: dict[int, ServoSetup] = {}
        imu = board if board is not None and board.carries_imu else None
        self._background = BackgroundRead(self.bus, self.joints, self.rows, imu)
        self._cycle = 0
        self._reopen_at = 0.0
        self._bytes_in, self._bytes_in_at = -1, 0.0
        self._verify_left = 0
        self._replies: Replies | None = None

    # Setting up -------------------------------------------------------------------------------

    def set_facts(self, servos: Mapping[int, ServoFacts]) -> None:
        """Take over the diagnostics of each servo, by place in the joint order."""
        self._facts = dict(servos)
        self.cyclic = CyclicRead(self.bus, list(servos.values()))

    def configure(self, row: int) -> str:
        """Set a servo's registers; return what it does not confirm, or nothing."""
        setup = ServoSetup(self._facts[row], self._limit_by)
        setup.run(self.bus)
        self.eeprom_writes += setup.eeprom_writes
        return setup.failed

    def reset_goal(self, row: int) -> bool:
        """Make a servo's present position its goal; return whether it confirms.

        One without a watchdog gets its goal with its torque: it may switch torque on by a goal.
        """
        servo = self._facts[row]
        ticks = self.bus.read_item(servo.id, servo.table["present_position"])
        if ticks is None:
            return False
        self.writer.forget()
        if not servo.table.has_watchdog:
            return True
        lowest, highest = goal_range(servo.table)
        goal = min(max(ticks, lowest), highest)
        return self.bus.write_item(servo.id, servo.table["goal_position"], goal)

    def unmute(self) -> None:
        """Make all servos confirm instructions, but where that is kept without power.

        There those that reply to pings alone are made to; torque must be off.
        """
        item = table_named(self.joints[0].servo.model.name)["status_return_level"]
        if not item.eeprom:
            self.writer.write_all(item.name, item.upper or 0)
            return
        for device in (joint.servo.id for joint in self.joints):
            is_silent = self.bus.ping(device) is None or self.bus.read_item(device, item) is None
            if is_silent and self.bus.hears(device):
                self.bus.write_item(device, item, item.upper or 0, tries=1)
                self.eeprom_writes += 1

    def read_tick(self) -> int | None:
        """Read the clock of the first servo [ms]; None if it has none, or is silent."""
        joint = self.joints[0]
        table = table_named(joint.servo.model.name)
        if "realtime_tick" not in table:
            return None
        return self.bus.read_item(joint.servo.id, table["realtime_tick"], tries=1)

    # Reading ----------------------------------------------------------------------------------

    def begin_cyclic(self) -> None:
        """Request position, velocity and current of all servos."""
        self._cycle += 1
        if self._is_mute():
            self._lose()  # for a cycle at least, in which the states note it
        elif self._is_usable():
            self._exchange(self.cyclic.begin)

    def collect_cyclic(self, limit: float) -> None:
        """Wait for the replies, up to a time of the monotonic clock [s]; see `apply_cyclic`."""
        self._replies = self._exchange(self.cyclic.collect, limit)

    @property
    def has_alert(self) -> bool:
        """Return whether a servo reports an alert in the newest replies."""
        return self._replies is not None and bool((self._replies.errors & ALERT).any())

    def apply_cyclic(self, states: ServoStates, now: float) -> None:
        """Take over the replies, at a time on the backend's clock [s]."""
        if self._replies is not None and len(self._replies.devices):
            states.update_cyclic(self._replies, now)
        self._replies = None

    def prepare_background(self, states: ServoStates) -> None:
        """Choose what to read in the background."""
        if not self.is_lost:
            self._background.prepare(states, self.cyclic.left_out)

    def begin_background(self, limit: float) -> None:
        """Request the board's IMU and the item that `prepare_background` chose."""
        self._exchange(self._background.begin, limit)

    def collect_background(self, states: ServoStates, limit: float) -> None:
        """Collect the replies of the background read."""
        self._exchange(self._background.collect, states, limit)

    def maintain(self, states: ServoStates, limit: float) -> None:
        """Use the rest of a cycle: verify torque, poll lost servos, set up restarted ones."""
        with self.bus.until(limit):
            for task in (self._verify_torque, self._poll, self._set_up_again):
                self._exchange(task, states, limit)

    # Writing ----------------------------------------------------------------------------------

    def write(self, commands: RegisterCommands, states: ServoStates, fresh: np.ndarray) -> None:
        """Write the commands of this chain's servos."""
        was_on = states.is_on[self.rows]
        self._exchange(self.writer.write, commands, states, fresh)
        if not self.is_lost and not np.array_equal(states.is_on[self.rows], was_on):
            self._verify_left = VERIFY_TRIES

    def note_loss(self, states: ServoStates) -> None:
        """Note the servos of a lost port in their states."""
        if self.is_lost:
            states.note_lost_port(self.rows)
            self._setups.clear()

    # Releasing --------------------------------------------------------------------------------

    def release(self, states: ServoStates) -> bool:
        """Switch off all torque and watchdogs; return whether all driven joints confirm it."""
        self._reopen_at = 0.0
        if self._is_usable() and self.bus.port.is_open:
            confirmed = self._exchange(self._clear, states, TORQUE, TORQUE, WATCHDOG) or []
            states.may_drive[confirmed] = False
        return not states.may_drive[self.rows].any()

    def disarm(self, states: ServoStates) -> Sequence[int]:
        """Switch off the watchdogs, so that servos hold while they have power.

        Returns the driven joints that confirm it, by row: those with torque and no watchdog.
        """
        if self.is_watched:
            return self._exchange(self._clear, states, WATCHDOG, WATCHDOG, holds=True) or []
        return self._exchange(self._clear, states, holds=True) or []

    def _clear(self, states: ServoStates, *registers: str, holds: bool = False) -> list[int]:
        """Set registers of all servos to 0; return the driven rows that confirm the first.

        With ``holds``, only those that also confirm their torque.
        """
        for register in registers:  # sync writes are not confirmed
            self.writer.write_all(register, 0)
        table, confirmed = table_named(self.joints[0].servo.model.name), []
        for joint, row in zip(self.joints, self.rows.tolist(), strict=True):
            device = joint.servo.id
            if not states.may_drive[row]:
                continue
            is_clear = all(
                self.bus.read_item(device, item, tries=1) == 0
                or self.bus.write_item(device, item, 0, tries=2)
                for item in map(table.__getitem__, registers[:1])
            )
            if is_clear and (not holds or self.bus.read_item(device, self._torque) == 1):
                confirmed.append(row)
        return confirmed

    # The port ---------------------------------------------------------------------------------

    def _exchange(self, talk: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T | None:
        """Talk to the servos, unless the port is lost; note if it is lost meanwhile."""
        if self.is_lost:
            return None
        try:
            return talk(*args, **kwargs)
        except PortLostError:
            self._lose()
            return None

    def _lose(self) -> None:
        self.is_lost = True
        self._replies = None
        self.bus.port.close()
        self._reopen_at = time.monotonic() + REOPEN_EVERY

    def _is_mute(self) -> bool:
        """Return whether nothing at all has come from the port for long.

        Another program that opens the port may change its speed, and some adapters hang:
        opening it again is all that can be done from here.
        """
        count, now = self.bus.statistics.bytes_in, time.monotonic()
        if count != self._bytes_in or self.is_lost:
            self._bytes_in, self._bytes_in_at = count, now
        return now - self._bytes_in_at > MUTE_TIME

    def _is_usable(self) -> bool:
        """Return whether the port is there; open it again if it was lost."""
        if not self.is_lost:
            return True
        if time.monotonic() < self._reopen_at:
            return False
        try:
            self.bus.port.open()
            self.is_lost = False
            self.writer.write_all(TORQUE, 0)
            self.writer.forget()
        except PortError:
            self._lose()
        return not self.is_lost

    # Maintenance ------------------------------------------------------------------------------

    def _verify_torque(self, states: ServoStates, limit: float) -> None:
        """Read back the torque registers, which are written without confirmation."""
        if not self._verify_left:
            return
        ids, out = (joint.servo.id for joint in self.joints), self.cyclic.left_out
        spans = {i: self._torque.span for i in ids if i not in out}
        if not spans:
            return
        fast = self.cyclic.kind is GroupKind.FAST and len(spans) > 1
        request = self.bus.group(spans, fast=fast)
        if not has_time(self.bus, request, limit):
            return
        self.bus.begin(request)
        replies = self.bus.collect_group(request, limit)
        self._verify_left -= 1
        agree = states.update_torque(replies, is_final=self._verify_left == 0)
        if agree and len(replies.devices) == len(spans):
            self._verify_left = 0

    def _poll(self, states: ServoStates, limit: float) -> None:
        until = time.monotonic() + POLL_WAIT
        device = self.cyclic.due_poll() if until <= limit else None
        if device is None:
            return
        request = self.bus.group({device: self._torque.span})
        self.bus.begin(request)
        if self.bus.collect(request, min(limit, until + self.bus.answer_margin)):
            self.cyclic.restore(device)
            row = states.row(device)
            if not states.is_on[row]:
                states.note_restart(row)

    def _set_up_again(self, states: ServoStates, limit: float) -> None:
        """Set up servos that may have restarted, so that they may have torque again."""
        if states.is_ready.all():
            return
        out, steps = self.cyclic.left_out, 0
        waiting = self.rows[~states.is_ready[self.rows] & (states.alert[self.rows] == 0)]
        # Each cycle begins with another one, in case one of them makes no progress.
        for row in np.roll(waiting, self._cycle).tolist():
            if self._facts[row].id in out:
                continue
            again = ServoSetup(self._facts[row], self._limit_by, recheck=True)
            setup = self._setups.setdefault(row, again)
            while not setup.done:
                if steps == SETUP_STEPS or time.monotonic() + STEP_TIME > limit:
                    return
                steps += 1
                if not setup.step(self.bus):
                    return
            self.eeprom_writes += setup.eeprom_writes
            del self._setups[row]
            states.note_ready(row)
            self.writer.forget()


class BackgroundRead:
    """Reads a board's IMU and one item of one of its servos in each cycle.

    Both go in one request, which spares a turnaround. Urgent items go first: the cause of an
    alert, then the torque of a servo that may have restarted.
    """

    def __init__(
        self, bus: DynamixelBus, joints: Sequence[Joint], rows: np.ndarray, board: Board | None
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
        table = self._tables[row]
        if item not in table:
            item = TORQUE
        return table.span(item, "present_temperature" if item == SUPPLY else item)


def has_time(bus: DynamixelBus, request: Request | None, limit: float) -> bool:
    """Return whether a request can be answered before a time of the monotonic clock [s]."""
    return request is not None and time.monotonic() + bus.duration(request) + SPARE < limit
