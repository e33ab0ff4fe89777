"""Backend of a robot on Dynamixel servos: real ones, or those of a virtual bus."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from drivers.backend import Backend, Release
from drivers.dynamixel.bus import ANSWER_MARGIN, LOCK_STEP_MARGIN, TRIES, BusStatistics
from drivers.dynamixel.clock import Clock
from drivers.dynamixel.command_writer import CommandConverter
from drivers.dynamixel.control_table import SI_DIGITS
from drivers.dynamixel.diagnostics import READ_SHARE, Diagnostics, DiagnosticsError, name_of
from drivers.dynamixel.protocol2 import Instruction
from drivers.dynamixel.robot_ports import build_ports, find_imu, open_ports, using_margin
from drivers.dynamixel.servo_chain import ServoChain
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.startup import (
    BOOT_MARGIN,
    BOOT_TIME,
    SETUP_MARGIN,
    check_description,
    check_limit_mode,
    configure_servos,
    diagnose_robot,
    measure_once,
    name_devices,
)
from drivers.errors import NotConnectedError, SetupError, UnreleasedError
from drivers.imu.fusion import ImuFusion
from drivers.imu.source import ImuSource
from drivers.interrupts import deferred_interrupts
from drivers.safety_limits import DERATE_MARGIN, HOT_MARGIN, GuardLimits
from drivers.serial_port import MakePort, PortError, SerialPort, is_pseudo_terminal
from drivers.servo_units import ServoUnits
from drivers.state import Command, State
from robots import Robot
from robots.servo import LimitMode

# s in which a silent servo is told again to switch its torque off: with a watchdog, and without
RELEASE_TIME, UNWATCHED_RELEASE_TIME = 1.0, 5.0
RELEASE_WAIT = 0.01  # s between two tries
FRESH = 2.5  # periods; torque does not begin from an older position
WATCHDOG_STEP = 0.02  # s a count (e-manual, Bus Watchdog)
# Of the watchdog's time: after such a pause between two commands the servos may have stopped.
PAUSE_SHARE = 0.8
STILL = 0.1  # s in which the clock of a servo, which counts milliseconds, must have moved on


@dataclass(frozen=True, kw_only=True)
class DriverOptions:
    """How a driver uses its buses; the defaults suit a robot."""

    answer_margin: float | None = None
    """How long a reply may take beyond its bytes' own time [s]; None for `ANSWER_MARGIN`, or
    `LOCK_STEP_MARGIN` with simulated time."""
    make_port: MakePort = SerialPort
    """Makes the port of a path and a baud rate [bit/s]."""


class DynamixelBackend(Backend):
    """A robot whose servos and IMU are on one or more Dynamixel buses.

    One read and one write a cycle, as every backend. ``read`` measures positions, velocities
    and currents of all servos, the IMU, and one slow value of one servo; ``write`` sends goals,
    and gains and limits where they changed. Without a reply from a servo or a port, its last
    values are repeated and grow older (`State.joint_age`), for the guard to judge.

    Torque comes on at the present position only. A servo that has restarted is set up again
    first; one whose port was lost waits for a command that releases it.
    """

    has_wire = True

    def __init__(
        self,
        robot: Robot,
        ports: Mapping[str, str] | str,
        *,
        clock: Clock | None = None,
        limit_by: LimitMode | None = None,
        imu: ImuSource | None = None,
        without_imu: bool = False,
        options: DriverOptions | None = None,
    ) -> None:
        """Prepare a backend; nothing is opened yet.

        Args:
            robot: Robot on the buses, calibrated.
            ports: Device of each port, by its name in the robot's description; ``imu`` for an
                IMU on another serial port or I2C bus than described. Of a robot with one port, its
                device.
            clock: Clock of the measurements; ``None`` for wall time. With simulated time (a
                virtual bus in lock-step) no cycle has a deadline.
            limit_by: What torque limits act on: the current, in current-based position mode, or
                the PWM, in extended position mode; ``None`` for the robot's own.
            imu: Source of the IMU's samples; ``None`` for that of the robot's description.
            without_imu: Measure neither angular velocity nor orientation, of a robot that has no
                IMU.
            options: How the buses are used; ``None`` for the defaults.

        Raises:
            SetupError: if the robot has no bus, no IMU (or, without it, has one), or other ports,
                or if its servos do not limit torque like that.
            ValueError: if robot or ports are of another type.
        """
        ports = name_devices(robot, ports)
        self.robot, self._bus_settings = robot, check_description(robot, ports, without_imu)
        options = options or DriverOptions()
        self.period = robot.control_period
        self._clock = clock or Clock()
        self.limit_by: LimitMode = check_limit_mode(robot, limit_by or robot.limit_by)
        self._converter, self._units = CommandConverter(robot, self.limit_by), ServoUnits(robot)
        margin = ANSWER_MARGIN if self._clock.is_real else LOCK_STEP_MARGIN
        self._margin = margin if options.answer_margin is None else options.answer_margin
        self._watchdog = max(1, round(self._bus_settings.watchdog / WATCHDOG_STEP))
        self.diagnostics = Diagnostics((), ())
        """Findings of `connect`."""
        built = build_ports(
            robot, ports, options.make_port, answer_margin=self._margin, sleeps=self._clock.is_real
        )
        self.chains = [ServoChain(port, robot, self._watchdog, self.limit_by) for port in built]
        self.imu = None if without_imu else imu or find_imu(robot, built, ports)
        """Source of the IMU's samples; None without one."""
        self._connected = False
        self._unreleased: tuple[str, ...] = ()
        self._reset()

    def _reset(self) -> None:
        self._states = ServoStates(self.robot, self.period)
        self._fusion = ImuFusion(self.period)
        self._state: State | None = None
        self._written_at = -np.inf
        self._bytes_at_last_read = self._bytes_at_read = 0

    @property
    def statistics(self) -> Mapping[str, BusStatistics]:
        """Return the traffic of each bus, by port name."""
        return {chain.name: chain.bus.statistics for chain in self.chains}

    @property
    def cycle_bytes(self) -> int:
        """Return the bytes on all wires, both ways, of the last whole cycle."""
        return self._bytes_at_read - self._bytes_at_last_read

    @property
    def eeprom_writes(self) -> int:
        """Return the number of writes to the servos' EEPROM, which wears out."""
        return sum(chain.eeprom_writes for chain in self.chains)

    # Opening and closing ----------------------------------------------------------------------

    def connect(self) -> None:
        """Open the ports, diagnose and configure all devices, and measure once.

        Torque is off from here on. Harmless if it is connected already. Raises `PortError`, or one
        `DiagnosticsError` that lists all that is wrong.
        """
        if self._connected:
            return
        may_drive = self._states.may_drive  # joints that may still drive must be released
        self._reset()
        self._states.may_drive = may_drive
        chains, states = self.chains, self._states
        buses = [chain.bus for chain in chains]
        try:
            open_ports(buses)
            with using_margin(buses, max(self._margin, SETUP_MARGIN)):
                period = self.period if self._clock.is_real else None
                self.diagnostics = diagnose_robot(self.robot, chains, self.imu, period)
                if self.diagnostics.errors:
                    raise DiagnosticsError(self.diagnostics.errors)
                configure_servos(self.diagnostics, chains, states)
                now = self._clock.now()
                sample = measure_once(chains, self.imu, states, now)
                if sample is not None:
                    self._fusion.start(sample, now)
        except BaseException:
            self.close()
            raise
        for servo in self.diagnostics.servos:
            self._converter.note_limits(states.row(servo.id), servo.registers)
        self._connected = True

    def narrow(self, limits: GuardLimits) -> GuardLimits:
        """Narrow a guard's limits to those at which the servos switch themselves off."""
        servos = {servo.joint.name: servo for servo in self.diagnostics.servos}
        off = np.array([servos[name].to_si("temperature_limit") for name in self.robot.joint_names])
        lowest = [servo.to_si("min_voltage_limit", 0.0) for servo in servos.values()]
        return replace(
            limits,
            max_temperature=np.minimum(limits.max_temperature, off - HOT_MARGIN),
            derate_temperature=np.minimum(limits.derate_temperature, off - DERATE_MARGIN),
            min_voltage=max([limits.min_voltage, *lowest]),
            shutdown_voltage=max([limits.shutdown_voltage, *lowest]),
        )

    def close(self) -> None:
        """Release every joint that can be reached, and close the ports.

        A signal that arrives meanwhile is handled afterwards.

        Raises:
            UnreleasedError: if joints that had torque do not confirm that it is off.
        """
        was_open = self._is_open
        try:
            with deferred_interrupts():
                self._close()
        except KeyboardInterrupt:  # it may have come before the block; twice is harmless
            with deferred_interrupts():
                self._close()
            if not (was_open and self._unreleased):
                raise
        if was_open and self._unreleased:
            raise UnreleasedError(
                [joint for joint in self.robot.joints if joint.name in self._unreleased],
                watched=all(chain.is_watched for chain in self.chains),
            )

    def _close(self) -> None:
        self._connected = False
        if self.release is Release.LIMP and self._is_open:
            self._release()
            driven = np.flatnonzero(self._states.may_drive)
            self._unreleased = tuple(self.robot.joint_names[row] for row in driven)
        for chain in self.chains:
            chain.bus.port.close()
            chain.is_lost = False
        if self.imu is not None:
            self.imu.close()

    def _release(self) -> None:
        """Release all joints, and those that do not confirm it again and again for a while."""
        left = self.chains
        until = time.monotonic()
        until += RELEASE_TIME if all(c.is_watched for c in left) else UNWATCHED_RELEASE_TIME
        while left := [chain for chain in left if not chain.release(self._states)]:
            if time.monotonic() > until:
                return
            time.sleep(RELEASE_WAIT)

    @property
    def _is_open(self) -> bool:
        return any(chain.bus.port.is_open or chain.is_lost for chain in self.chains)

    @property
    def unreleased(self) -> tuple[str, ...]:
        """Return the joints that had torque and did not confirm at ``close`` that it is off."""
        return self._unreleased

    def hand_over(self) -> tuple[str, ...]:
        """Leave the joints under torque at ``close``, unless one does not confirm; return those.

        Their watchdogs are switched off, so that they hold without a program.
        """
        self._check_connected()
        states = self._states
        unconfirmed = states.may_drive.copy()
        for chain in self.chains:
            unconfirmed[list(chain.disarm(states))] = False
        if unconfirmed.any():  # all are watched again
            states.must_seed |= states.is_on
        else:
            self.release = Release.HOLD
        return tuple(self.robot.joint_names[row] for row in np.flatnonzero(unconfirmed))

    # The cycle --------------------------------------------------------------------------------

    def read(self) -> State:
        """Measure the robot; within half a period, return the last measurement again."""
        self._check_connected()
        now = self._clock.now()
        last = self._state
        if last is not None and now - last.time < self.period / 2:
            return last
        self._measure(now)
        self._state = self._build_state(now)
        return self._state

    def write(self, command: Command) -> Command:
        """Send a command; return what was really sent to the servos."""
        self._check_connected()
        requested = self._converter.to_registers(command)
        states, now = self._states, self._clock.now()
        fresh = now - states.stamp < FRESH * self.period
        was_paused = now - self._written_at > PAUSE_SHARE * self._bus_settings.watchdog
        permitted = states.permit_torque(requested.torque, fresh, was_paused=was_paused)
        for chain in self.chains:
            chain.write(replace(requested, torque=permitted), states, fresh)
            chain.note_loss(states)
        self._written_at, self._state = now, None
        self._clock.pass_period(self.period)
        return self._converter.to_command(
            replace(requested, torque=states.is_on & permitted), command
        )

    def _measure(self, now: float) -> None:
        states, chains = self._states, self.chains
        counts = [chain.bus.statistics for chain in chains]
        self._bytes_at_last_read = self._bytes_at_read
        self._bytes_at_read = sum(count.bytes_in + count.bytes_out for count in counts)
        limit = np.inf
        if self._clock.is_real:
            limit = time.monotonic() + READ_SHARE * self.period
        if self.imu is not None:
            self.imu.request(now)  # early, because its own line takes time
        for chain in chains:
            chain.begin_cyclic()
        for chain in chains:
            chain.prepare_background(states)
        for chain in chains:
            chain.collect_cyclic(limit)
        for chain in chains:
            if chain.has_alert:  # it determines the next background read
                chain.apply_cyclic(states, now)
                chain.prepare_background(states)
            chain.begin_background(limit)
        for chain in chains:  # while the next replies are on the wire
            chain.apply_cyclic(states, now)
        for chain in chains:
            chain.collect_background(states, limit)
        if self.imu is not None and (sample := self.imu.poll()) is not None:
            speed = np.abs(self.robot.transmission.to_joint(states.velocity)).max()
            self._fusion.update(sample, now, float(speed), is_limp=not states.is_on.any())
        for chain in chains:
            chain.maintain(states, limit)
            chain.note_loss(states)

    def _build_state(self, now: float) -> State:
        states, imu = self._states, None if self.imu is None else self._fusion
        return State(
            time=now,
            joint_pos=self._units.to_rad(states.ticks),
            joint_vel=self.robot.transmission.to_joint(states.velocity.copy()),
            joint_current=states.current.copy(),
            gyro=imu.gyro if imu else np.zeros(0),
            orientation=imu.orientation if imu else np.zeros(0),
            temperature=states.temperature.copy(),
            voltage=round(float(states.voltage.mean()), SI_DIGITS),
            joint_age=now - states.stamp,
            imu_age=now - imu.stamp if imu else 0.0,
            alert=states.alert.copy(),
        )

    # Services ---------------------------------------------------------------------------------

    def waits_for_commands(self) -> bool:
        """Return whether time stands still in the servos while they get no commands.

        So it is on a virtual bus in lock-step, served by any process: there a driver needs a
        `CycleClock`. It is seen by the servos' own clocks (Realtime Tick), which AX, XL-320 and
        Feetech's lack: of those it is not known, and not said. A port that is no pseudo-terminal
        leads to real servos.
        """
        self._check_connected()
        if not all(is_pseudo_terminal(chain.bus.port.path) for chain in self.chains):
            return False
        with using_margin((chain.bus for chain in self.chains), SETUP_MARGIN):
            for _ in range(TRIES):
                ticks = [[chain.read_tick() for chain in self.chains]]
                for _ in range(2):  # once is not enough: a clock that is late jumps back
                    time.sleep(STILL)
                    ticks.append([chain.read_tick() for chain in self.chains])
                if all(None not in tick for tick in ticks):
                    return ticks[0] == ticks[1] == ticks[2]
        return False

    def reboot(self, joint: str) -> None:
        """Restart a joint's servo and configure it, torque off, its goal at its position.

        This clears a latched hardware error, so it should be decided by a person. It takes
        half a second, in which all other joints should have no torque either. Raises `SetupError`.
        """
        self._check_connected()
        row = self.robot.joint_names.index(joint)
        states, device = self._states, self.robot.joints[row]
        chain = next(chain for chain in self.chains if row in chain.rows)
        if states.is_on[row] and not states.alert[row]:
            failure = "has torque; release it before it is rebooted"
        else:
            states.note_restart(row)
            try:
                with using_margin((c.bus for c in self.chains), BOOT_MARGIN):
                    failure = self._restart(chain, row)
            except PortError as error:
                raise SetupError(f"{name_of(device)}: {error}") from error
        if failure:
            raise SetupError(f"{name_of(device)}: {failure}")

    def _restart(self, chain: ServoChain, row: int) -> str:
        """Restart a servo and configure it; return what went wrong, empty for nothing."""
        device = self.robot.joints[row].servo.id
        if Instruction.REBOOT not in chain.bus.wire.instructions:
            return "knows no restart over its bus: switch its power off and on"
        if chain.bus.reboot(device, TRIES) is None:
            return "does not confirm that it reboots"
        until = time.monotonic() + BOOT_TIME
        # Pings also feed the other servos' watchdogs.
        while (pong := chain.bus.ping(device)) is None:
            if time.monotonic() > until:
                return f"silent {BOOT_TIME:g} s after its reboot"
        if failure := chain.configure(row):
            return failure
        if not chain.reset_goal(row):
            return "its position cannot be read"
        self._states.note_rebooted(row, has_alert=pong.alert)
        return ""

    # Helpers ----------------------------------------------------------------------------------

    def _check_connected(self) -> None:
        if not self._connected:
            raise NotConnectedError(f"{self.robot.name} on its servo bus")
