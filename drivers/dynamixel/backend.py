"""The backend of a robot on Dynamixel servos: real ones, or those of a virtual bus."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from enum import Enum

import numpy as np

from drivers.backend import ClosesItself
from drivers.dynamixel.bus import ANSWER_MARGIN, BusStatistics, DynamixelBus
from drivers.dynamixel.clock import Clock, WallClock
from drivers.dynamixel.command_writer import FRESH, RegisterCommands, Translator
from drivers.dynamixel.diagnostics import Diagnostics, DiagnosticsError, name_of
from drivers.dynamixel.opencr import BodyImu, OpenCr
from drivers.dynamixel.port import Port, PortError, SerialPort
from drivers.dynamixel.protocol2 import ALERT
from drivers.dynamixel.servo_chain import ServoChain
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.startup import (
    BOOT_MARGIN,
    BOOT_TIME,
    SETUP_MARGIN,
    look_at_all,
    margin,
    measure_first,
    open_ports,
    set_up_all,
)
from drivers.errors import NotConnectedError, SetupError
from drivers.servo_units import ServoUnits
from drivers.state import Command, State
from robots import BusSettings, Joint, Robot

READ_SHARE = 0.75  # of the period in which all reading has to be done
WATCHDOG_STEP = 0.02  # s a count (e-manual, Bus Watchdog)
# Of the watchdog's time: after such a pause between two commands the servos may have stopped
# by themselves.
PAUSE_SHARE = 0.8
REBOOT_TRIES = 3

MakePort = Callable[[str, int], Port]


class Release(Enum):
    """What `close` leaves behind."""

    LIMP = "no joint has torque"
    HOLD = "joints stay where they are, for as long as the servos have power"


class RebootError(SetupError):
    """A servo was not rebooted, or has not come back."""

    def __init__(self, joint: Joint, text: str) -> None:
        super().__init__(f"{name_of(joint)}: {text}")
        self.joint = joint.name


class DynamixelBackend(ClosesItself):
    """A robot whose servos and IMU hang on one or more Dynamixel buses.

    One read and one write a cycle, as every backend. ``read`` takes the positions, speeds and
    currents of all servos, the IMU, and one of the slow values of one servo; ``write`` sends
    goals, and gains and limits where they changed. A silent servo, or a lost port, costs only
    its own values: they are repeated and grow older (`State.joint_age`); what to do about it
    is the guard's business.

    Torque comes on at the present position only. A servo that has restarted meanwhile is set
    up again first; one whose port was lost waits for a command that releases it.
    """

    def __init__(
        self,
        robot: Robot,
        ports: Mapping[str, str],
        *,
        clock: Clock | None = None,
        period: float | None = None,
        answer_margin: float = ANSWER_MARGIN,
        make_port: MakePort = SerialPort,
        release: Release = Release.LIMP,
    ) -> None:
        """Prepare a backend; nothing is opened yet.

        Args:
            robot: Robot on the buses, calibrated.
            ports: Device of each port, by its name in the robot's description.
            clock: Clock of the measurements; ``None`` for the wall's. With one that does not
                pass by itself (a virtual bus in lock-step) no cycle has a deadline.
            period: Control period [s]; ``None`` for the robot's own.
            answer_margin: How long an answer may take beyond its bytes' own time [s].
            make_port: Makes a port of a path and a speed: `SerialPort` or `SdkPort`.
            release: What `close` leaves behind; it may be changed until then.

        Raises:
            SetupError: when the robot has no bus, no IMU, or other ports.
        """
        self._robot, self._bus_settings = robot, _check_robot(robot, ports)
        self._period = robot.control_period if period is None else period
        self._clock = clock or WallClock()
        self.release = release
        self._translator, self._units = Translator(robot), ServoUnits(robot)
        self._margin = answer_margin
        self._watchdog = max(1, round(self._bus_settings.watchdog / WATCHDOG_STEP))
        self.audit = Diagnostics((), ())
        """What `connect` found."""
        self.unreleased: tuple[str, ...] = ()
        """Joints that did not confirm, at the last `close`, that they are limp."""
        self.lines = self._build_lines(ports, make_port)
        self._connected = False
        self._forget()

    def _forget(self) -> None:
        self._bank = ServoStates(self._robot, self._period)
        self._imu = BodyImu(self._period)
        self._state: State | None = None
        self._written_at = -np.inf
        self._cycle_start = self._bytes_before = 0

    @property
    def robot(self) -> Robot:
        """Return the robot on the buses."""
        return self._robot

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return self._period

    @property
    def statistics(self) -> Mapping[str, BusStatistics]:
        """Return what has passed over each bus, by port name."""
        names = [port.name for port in self._bus_settings.ports]
        return {n: line.bus.statistics for n, line in zip(names, self.lines, strict=True)}

    @property
    def cycle_bytes(self) -> int:
        """Return the bytes on all wires, both ways, of the last whole cycle."""
        return self._bytes_before - self._cycle_start

    @property
    def eeprom_writes(self) -> int:
        """Return how often a register was written that only bears so many writes."""
        return sum(line.eeprom_writes for line in self.lines)

    @property
    def lost_ports(self) -> list[str]:
        """Return the ports that are gone, by name."""
        names = [port.name for port in self._bus_settings.ports]
        return [n for n, line in zip(names, self.lines, strict=True) if line.is_lost]

    # Opening and closing ----------------------------------------------------------------------

    def connect(self) -> None:
        """Open the ports, look at all devices, set them up, and take a first measurement.

        Joints are limp from here on. Harmless when it is connected already.

        Raises:
            PortError: when a port does not open.
            AuditError: telling all that is wrong at once.
        """
        if self._connected:
            return
        self._forget()
        lines, bank = self.lines, self._bank
        try:
            open_ports(lines)
            with margin(lines, max(self._margin, SETUP_MARGIN)):
                period = self._period if self._clock.is_real else None
                self.audit = look_at_all(self._robot, lines, period)
                if self.audit.errors:
                    raise DiagnosticsError(self.audit.errors)
                set_up_all(self.audit, lines, bank)
                now = self._clock.now()
                self._imu.start(measure_first(lines, bank, now), now)
        except BaseException:
            self.close()
            raise
        for servo in self.audit.servos:
            self._translator.pwm_limit[bank.row(servo.id)] = servo.registers["pwm_limit"]
        self._connected = True

    def close(self) -> None:
        """Release every joint, as far as any can be reached, and the ports."""
        self._connected = False
        unreleased: list[Joint] = []
        for line in self.lines:
            if self.release is Release.HOLD:
                line.disarm()
            elif line.bus.port.is_open or line.is_lost:
                unreleased += line.release()
            line.bus.port.close()
            line.is_lost = False
        self.unreleased = tuple(joint.name for joint in unreleased)

    # The cycle --------------------------------------------------------------------------------

    def read(self) -> State:
        """Measure the robot; within half a period, what was measured last still holds."""
        self._check_connected()
        now = self._clock.now()
        last = self._state
        if last is not None and now - last.time < self._period / 2:
            return last
        self._measure(now)
        self._state = self._build_state(now)
        return self._state

    def write(self, command: Command) -> Command:
        """Send a command; return what the servos were really told."""
        self._check_connected()
        asked = self._translator.to_orders(command)
        bank, now = self._bank, self._clock.now()
        bank.is_locked &= asked.torque
        if now - self._written_at > PAUSE_SHARE * self._bus_settings.watchdog:
            bank.must_seed |= bank.is_on
        fresh = now - bank.stamp < FRESH * self._period
        may = asked.torque & bank.is_ready & ~bank.is_locked & (bank.is_on | fresh)
        orders = RegisterCommands(goal=asked.goal, p_gain=asked.p_gain, pwm=asked.pwm, torque=may)
        for line in self.lines:
            line.write(orders, bank, fresh)
            line.note_loss(bank)
        self._written_at, self._state = now, None
        self._clock.pass_period(self._period)
        return self._translator.to_command(
            RegisterCommands(
                goal=orders.goal, p_gain=orders.p_gain, pwm=orders.pwm, torque=bank.is_on & may
            ),
            command,
        )

    def _measure(self, now: float) -> None:
        self._cycle_start, self._bytes_before = self._bytes_before, self._count_bytes()
        bank, lines = self._bank, self.lines
        limit = np.inf
        if self._clock.is_real:
            limit = time.monotonic() + READ_SHARE * self._period
        for line in lines:
            line.ask_group()
        for line in lines:
            line.prepare_look(bank)
        for line in lines:
            line.collect_group(limit)
        for line in lines:
            if line.has_alert:  # it decides what is asked next
                line.take_group(bank, now)
                line.prepare_look(bank)
            line.ask_look(limit)
        for line in lines:  # while the next answers are on the wire
            line.take_group(bank, now)
        for line in lines:
            line.take_look(bank, self._imu, now, limit)
        for line in lines:
            line.tend(bank, limit)
            line.note_loss(bank)

    def _build_state(self, now: float) -> State:
        bank, imu = self._bank, self._imu
        return State(
            time=now,
            joint_pos=self._units.to_rad(bank.ticks),
            joint_vel=bank.velocity.copy(),
            joint_current=bank.current.copy(),
            gyro=imu.gyro,
            orientation=imu.orientation,
            temperature=bank.temperature.copy(),
            voltage=float(bank.voltage.sum()) / self._robot.n,
            joint_age=now - bank.stamp,
            imu_age=now - imu.stamp,
            alert=bank.alert.copy(),
        )

    def _count_bytes(self) -> int:
        told = [line.bus.statistics for line in self.lines]
        return sum(statistics.bytes_in + statistics.bytes_out for statistics in told)

    # Services ---------------------------------------------------------------------------------

    def reboot(self, joint: str) -> None:
        """Restart a joint's servo and set it up again, limp, its goal where it is.

        A latched hardware error is forgotten by this, so nobody but a person, or who acts for
        one, should ask for it. It takes as long as the servo does, a good half second: all
        other joints should be limp too.

        Raises:
            RebootError: when the joint has torque, or the servo does not come back.
        """
        self._check_connected()
        row = self._robot.joint_names.index(joint)
        bank, device = self._bank, self._robot.joints[row]
        line = next(line for line in self.lines if row in line.rows)
        if bank.is_on[row] and not bank.alert[row]:
            raise RebootError(device, "has torque; release it before it is rebooted")
        bank.note_restart(row)
        try:
            with margin(self.lines, BOOT_MARGIN):
                self._restart(line, row)
        except PortError as error:
            raise RebootError(device, str(error)) from error

    def _restart(self, line: ServoChain, row: int) -> None:
        device, bank = self._robot.joints[row], self._bank
        if line.bus.reboot(device.servo.id, REBOOT_TRIES) is None:
            raise RebootError(device, "does not confirm that it reboots")
        until = time.monotonic() + BOOT_TIME
        pong = None
        # Asking also feeds the other servos' watchdogs.
        while pong is None:
            if time.monotonic() > until:
                raise RebootError(device, f"silent {BOOT_TIME:g} s after its reboot")
            pong = line.bus.ping(device.servo.id)
        if fault := line.configure(row):
            raise RebootError(device, fault)
        if not line.seed(row):
            raise RebootError(device, "does not tell where it is")
        bank.note_ready(row)
        bank.alert[row] = ALERT if pong.alert else 0

    # Helpers ----------------------------------------------------------------------------------

    def _build_lines(self, ports: Mapping[str, str], make_port: MakePort) -> list[ServoChain]:
        settings, lines = self._bus_settings, []
        names = self._robot.joint_names
        for port in settings.ports:
            bus = DynamixelBus(
                make_port(ports[port.name], settings.baud),
                answer_margin=self._margin,
                naps=self._clock.is_real,
            )
            board = settings.board
            here = OpenCr(bus, board) if board and board.port == port.name else None
            rows = np.sort([names.index(joint) for joint in port.joints])
            lines.append(ServoChain(bus, self._robot, rows, self._watchdog, here))
        return lines

    def _check_connected(self) -> None:
        if not self._connected:
            raise NotConnectedError(f"{self._robot.name} on its servo bus")


def _check_robot(robot: Robot, ports: Mapping[str, str]) -> BusSettings:
    bus = robot.bus
    if bus is None:
        raise SetupError(
            f"robot '{robot.name}' has no servo bus: add a [bus] table to its robot.toml"
        )
    if bus.board is None:
        raise SetupError(
            f"robot '{robot.name}' has no IMU on its bus: add a [bus.board] table to its robot.toml"
        )
    wanted = [port.name for port in bus.ports]
    if sorted(ports) != sorted(wanted):
        raise SetupError(
            f"robot '{robot.name}' has the ports {', '.join(wanted)}; "
            f"devices were named for: {', '.join(ports) or 'none'}"
        )
    return bus
