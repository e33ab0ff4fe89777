"""Diagnosis of the servos of a bus before anything moves: which reply, and all problems."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import (
    ControlTable,
    DriveMode,
    Item,
    UnknownModelError,
    table_for,
    types_of,
)
from drivers.dynamixel.protocol2 import Span, Status, read_identity
from drivers.errors import DriverError
from drivers.servo_units import fits_one_turn, tick_range
from drivers.state import HardwareError
from robots import Joint, Robot
from robots.bus_settings import BAUD_RATES
from robots.servo import VOLTAGE_ROUNDING

MIN_FIRMWARE = 38  # the first with a bus watchdog (e-manual, XM430-W350)
FIRST_FREE_ID = 253  # from here on a secondary id means none
READ_SHARE = 0.75  # of the period within which all reads must end
SUPPLY_MARGIN = 0.5  # V that a supply sags or swings by under load
LIMITS = ("temperature_limit", "min_voltage_limit", "max_voltage_limit")
SEARCHED_RATES = tuple(reversed(BAUD_RATES[1:]))
"""Baud rates at which to search for servos that are silent at the right one [bit/s]."""


NO_WATCHDOG = (
    "has no bus watchdog: if the program dies, it holds its last goal",
    "have its power switch at hand: switched off, it is limp",
)
GARBLED = (
    "replies are garbled, as by two servos of one id",
    "unplug one at a time and give each its own id; else check the cable",
)


class Severity(Enum):
    """Consequence of a finding."""

    ERROR = "error"
    """The robot must not move and cannot be connected to."""
    FAULT = "fault"
    """The robot can be connected to, but gets no torque until this is repaired."""
    WARNING = "warning"
    """The robot may move."""


@dataclass(frozen=True)
class Finding:
    """A problem of one device, and its remedy."""

    severity: Severity
    device: str
    """Such as "joint 'r_knee' (id 13)"."""
    text: str
    remedy: str
    """What to do."""

    @classmethod
    def error(cls, device: str, text: str, remedy: str) -> Finding:
        """Build a finding that forbids motion."""
        return cls(Severity.ERROR, device, text, remedy)

    def __str__(self) -> str:
        return f"{self.device}: {self.text}; {self.remedy}"


class DiagnosticsError(DriverError):
    """A robot must not move; the message lists all findings at once."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        super().__init__(" | ".join(map(str, findings)))
        self.findings = tuple(findings)


@dataclass(frozen=True, kw_only=True)
class ServoFacts:
    """Model, firmware and registers of a servo."""

    joint: Joint
    table: ControlTable
    firmware: int
    registers: Mapping[str, int]
    """Values of the items that were read, by name."""
    angle: float | None = None
    """Joint angle [rad]; None until it is located, or if the servo it is coupled to is silent."""

    @property
    def id(self) -> int:
        """Return the servo's id."""
        return self.joint.servo.id

    @property
    def name(self) -> str:
        """Return its name in messages."""
        return name_of(self.joint)

    @property
    def supports_fast_read(self) -> bool:
        """Return whether it supports fast reads."""
        return self.table.supports_fast_read(self.firmware)

    @property
    def errors(self) -> int:
        """Return its hardware errors, as bits of `HardwareError`."""
        return self.table.name_errors(self.registers["hardware_error_status"])

    @property
    def mode_name(self) -> str:
        """Return the name of its operating mode; "-" if it has no register for that."""
        mode = self.registers.get("operating_mode")
        return "-" if mode is None else self.table.name_mode(mode)

    @property
    def voltage(self) -> float:
        """Return the supply [V]."""
        return self.to_si("present_input_voltage")

    @property
    def temperature(self) -> float:
        """Return the temperature [°C]."""
        return self.to_si("present_temperature")

    def to_si(self, name: str, missing: float = math.inf) -> float:
        """Return a register in its SI unit, or another value for one that it lacks."""
        return self.table[name].to_si(self.registers[name]) if name in self.registers else missing


@dataclass(frozen=True)
class Diagnostics:
    """Result of diagnosing servos."""

    servos: tuple[ServoFacts, ...]
    """Those whose registers could be read, in joint order."""
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Return the findings that forbid motion."""
        return tuple(f for f in self.findings if f.severity is Severity.ERROR)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Return the findings that forbid nothing."""
        return tuple(f for f in self.findings if f.severity is Severity.WARNING)


DIAGNOSED = (
    *("return_delay_time", "drive_mode", "operating_mode", "secondary_id", "homing_offset"),
    *("temperature_limit", "max_voltage_limit", "min_voltage_limit", "pwm_limit", "current_limit"),
    *("velocity_limit", "max_position_limit", "min_position_limit", "startup_configuration"),
    *("multi_turn_offset", "resolution_divider", "angular_resolution", "shutdown", "torque_enable"),
    *("status_return_level", "hardware_error_status", "position_d_gain", "position_i_gain"),
    *("position_p_gain", "goal_position", "present_position", "present_input_voltage"),
    "present_temperature",
)


def diagnose(bus: DynamixelBus, joints: Iterable[Joint]) -> Diagnostics:
    """Read the servos of some joints, and list all problems; nothing is written.

    Where the joints are follows from the servos of all ports: `startup.locate`.
    """
    joints = list(joints)
    servos: list[ServoFacts] = []
    findings: list[Finding] = []
    silent: list[Joint] = []
    for joint in joints:
        bytes_in = bus.statistics.bytes_in
        pong = bus.ping(joint.servo.id, TRIES)
        if pong is None and bus.statistics.bytes_in > bytes_in:
            findings.append(Finding.error(name_of(joint), *GARBLED))
        elif pong is None:
            silent.append(joint)
        else:
            servo = _examine(bus, joint, pong, findings)
            if servo is not None:
                servos.append(servo)
                findings += check_servo(servo)
    if silent:
        findings[:0] = _explain_silence(bus, silent, is_alone=not (servos or findings))
    return Diagnostics(tuple(servos), tuple(merge_findings(findings, joints)))


def read_items(
    bus: DynamixelBus, device: int, table: ControlTable, names: Iterable[str]
) -> dict[str, int] | None:
    """Read items of a servo, adjacent ones together; ``None`` if one could not be read.

    Items that its table lacks are left out.
    """
    values: dict[str, int] = {}
    for run in _group(sorted((table[n] for n in names if n in table), key=lambda i: i.address)):
        start = run[0].address
        status = bus.read(device, Span(start, run[-1].end - start), TRIES)
        if status is None or status.number:
            return None
        for item in run:
            at = item.address - start
            values[item.name] = item.decode(status.data[at : at + item.size])
    return values


def check_servo(servo: ServoFacts) -> list[Finding]:
    """List problems of a servo that `ServoSetup` cannot correct."""
    registers, model = servo.registers, servo.joint.servo.model
    found: list[Finding] = []

    def error(text: str, remedy: str) -> None:
        found.append(Finding.error(servo.name, text, remedy))

    def warn(text: str, remedy: str) -> None:
        found.append(Finding(Severity.WARNING, servo.name, text, remedy))

    if servo.table.has_watchdog and servo.firmware < MIN_FIRMWARE:
        error(
            f"firmware {servo.firmware} has no bus watchdog, expected {MIN_FIRMWARE} or newer",
            "update it with DYNAMIXEL Wizard",
        )
    window = servo.to_si("min_voltage_limit", 0.0), servo.to_si("max_voltage_limit")
    lowest, highest = max(model.min_voltage, window[0]), min(model.max_voltage, window[1])
    room = min(servo.voltage - window[0], window[1] - servo.voltage) + VOLTAGE_ROUNDING
    has_supply = model.accepts_supply(servo.voltage) and room >= 0.0
    alert = HardwareError(servo.errors)
    if alert and (has_supply or alert != HardwareError.VOLTAGE):
        found.append(_describe_alert(servo, alert))
    if not has_supply:
        error(
            f"supply is {servo.voltage:.1f} V, expected {lowest:.1f} to {highest:.1f} V",
            "charge or change the supply"
            + ("" if room >= 0.0 else ", or set its voltage limits back (getup doctor)"),
        )
    elif room < SUPPLY_MARGIN:
        warn(
            f"supply is {servo.voltage:.1f} V, only {room:.1f} V from its voltage limits of "
            f"{window[0]:g} to {window[1]:g} V, expected {SUPPLY_MARGIN:g} V or more",
            "charge or change the supply, or set its voltage limits back",
        )
    for name in (name for name in LIMITS if name in registers):
        item = servo.table[name]
        # Types that share a table are for different supplies, and shipped with other limits.
        is_known = item.unit != "V" or len(types_of(servo.table)) == 1
        if is_known and registers[name] != item.default:
            warn(
                f"{name.replace('_', ' ')} is {servo.to_si(name):g} {item.unit}, expected "
                f"{item.to_si(item.default or 0):g} {item.unit} as shipped",
                f"getup servo write {name}={item.default} --id ID sets it back",
            )
    if registers.get("drive_mode", 0) & DriveMode.REVERSE:
        error(
            f"drive mode is {registers['drive_mode']}, reversed: it would turn the wrong way",
            "set its drive mode to 0, then calibrate the joint",
        )
    if registers.get("secondary_id", FIRST_FREE_ID) < FIRST_FREE_ID:
        error(
            f"also responds to the secondary id {registers['secondary_id']}",
            "set its secondary id to 255",
        )
    if registers.get("homing_offset"):
        warn(
            f"homing offset is {registers['homing_offset']} ticks",
            "fine if the joint was calibrated with it, else set it to 0",
        )
    full = servo.table["pwm_limit"].upper or 0
    if registers["pwm_limit"] < min(full, servo.table["pwm_limit"].default or full):
        warn(
            f"PWM limit is {registers['pwm_limit']} of {full}: it has less torque",
            f"set it to {full} unless that is intended",
        )
    stalled = model.stall_current / model.current_step if model.has_current_mode else 0.0
    if registers.get("current_limit", math.inf) < stalled:
        warn(
            f"current limit is {registers['current_limit']}, {math.ceil(stalled)} is its stall "
            "current: it has less torque where torque is limited by current",
            f"set it to {math.ceil(stalled)} or more unless that is intended",
        )
    if registers.get("startup_configuration", 0) & 1:
        warn("switches torque on by itself at power-up", "set its startup configuration to 0")
    expected = HardwareError.OVERHEATING | HardwareError.OVERLOAD
    if servo.table.name_errors(registers["shutdown"]) & expected != expected:
        warn(
            f"shutdown is {registers['shutdown']}: overheating or overload would not stop it",
            f"set its shutdown to {servo.table['shutdown'].default}",
        )
    if not servo.table.has_watchdog:
        warn(*NO_WATCHDOG)
    ticks = tick_range(servo.joint)
    if not servo.table.counts_turns and not fits_one_turn(ticks, model.last_tick):
        warn(
            f"its range needs ticks {ticks[0]} to {ticks[1]}, expected 0 to {model.last_tick}",
            "mount its horn so that the range is within one turn, and calibrate it",
        )
    return found


def _describe_alert(servo: ServoFacts, alert: HardwareError) -> Finding:
    """Describe an error that a servo reports.

    The guard keeps torque off; to be rebooted, the servo must be connected first.
    """
    is_off = bool(alert & servo.table.name_errors(servo.registers["shutdown"]))
    text = f"{'has switched itself off' if is_off else 'reports an error'}: {alert.describe()}"
    is_warm = bool(alert & (HardwareError.OVERHEATING | HardwareError.OVERLOAD))
    remedy = "let it cool down and restart it" if is_warm else "restart it"
    return Finding(Severity.FAULT, servo.name, text, remedy)


def merge_findings(findings: Iterable[Finding], joints: Sequence[Joint]) -> list[Finding]:
    """Merge findings of several servos that say the same; the order is that of the first ones."""
    names, groups = [name_of(joint) for joint in joints], dict[Finding, list[str]]()
    for finding in findings:
        is_servo = finding.device in names
        same = replace(finding, device="") if is_servo else finding
        groups.setdefault(same, []).append(finding.device)
    return [
        replace(finding, device=_name_devices(devices, len(names)))
        for finding, devices in groups.items()
    ]


def _name_devices(devices: Sequence[str], servos: int) -> str:
    """Name the devices of a finding; all servos by their number."""
    return f"all {servos} servos" if 1 < servos == len(devices) else ", ".join(devices)


def find_baud_rate(bus: DynamixelBus, devices: Sequence[int]) -> int | None:
    """Search for devices at other baud rates; return the first with a reply [bit/s].

    The port's own rate is restored.
    """
    own = bus.port.baud
    try:
        for rate in SEARCHED_RATES:
            if rate == own:
                continue
            try:
                bus.port.set_baud(rate)
            except DriverError:
                continue  # the adapter does not support it
            if any(bus.ping(device) is not None for device in devices[:3]):
                return rate
    finally:
        bus.port.set_baud(own)
    return None


def check_cycle_time(path: str, baud: int, duration: float, period: float) -> list[Finding]:
    """Check that a cycle's bytes, some time [s] on the wire, pass within the control period [s].

    On a slower bus every value would be late, without any other finding.
    """
    if duration <= period:
        return []
    text = (
        f"at {baud} bit/s a cycle takes {duration * 1e3:.1f} ms on the wire, "
        f"expected {period * 1e3:.1f} ms"
    )
    remedy = "set the servos and bus.baud in robot.toml to a higher baud rate"
    return [Finding.error(f"port {path}", text, remedy)]


def name_of(joint: Joint) -> str:
    """Return the name of a joint's servo in messages."""
    return f"joint '{joint.name}' (id {joint.servo.id})"


def name_all(joints: Iterable[Joint]) -> str:
    """Return the names of several servos in messages."""
    return ", ".join(name_of(joint) for joint in joints)


def find_duplicate_ids(robot: Robot) -> list[Finding]:
    """Find ids that the robot's description gives to two joints, or to a joint and the board."""
    users: dict[int, list[str]] = {}
    for joint in robot.joints:
        users.setdefault(joint.servo.id, []).append(joint.name)
    if robot.bus is not None and robot.bus.board is not None:
        users.setdefault(robot.bus.board.id, []).append("the board")
    return [
        Finding.error(f"id {i}", f"belongs to {' and '.join(names)}", "edit robot.toml")
        for i, names in users.items()
        if len(names) > 1
    ]


def _examine(
    bus: DynamixelBus, joint: Joint, pong: Status, findings: list[Finding]
) -> ServoFacts | None:
    number, firmware = read_identity(pong)
    name, remedy = name_of(joint), "change the servo or robot.toml"
    try:
        table = table_for(number, firmware, bus.wire)
    except UnknownModelError as unknown:
        findings.append(Finding.error(name, str(unknown), remedy))
        return None
    if joint.servo.model.name not in types_of(table):
        text = f"is a {table.model}, expected {joint.servo.model.name}"
        findings.append(Finding.error(name, text, remedy))
        return None
    before = replace(bus.statistics)
    registers = read_items(bus, joint.servo.id, table, DIAGNOSED)
    if registers is None:
        since = bus.statistics - before
        text = "replies to a ping, but its registers cannot be read"
        problem = GARBLED if since.damaged or since.stale else (text, "check its cable and power")
        findings.append(Finding.error(name, *problem))
        return None
    if "hardware_error_status" not in table:  # each reply names them instead
        registers["hardware_error_status"] = pong.alarms
    return ServoFacts(joint=joint, table=table, firmware=firmware, registers=registers)


def _explain_silence(
    bus: DynamixelBus, silent: Sequence[Joint], *, is_alone: bool
) -> list[Finding]:
    port = bus.port
    if not is_alone:
        remedy = "check its cable, its power and its id (getup servo list)"
        return [Finding.error(name_all(silent), "silent", remedy)]
    names = _name_devices([name_of(joint) for joint in silent], len(silent))
    rate = find_baud_rate(bus, [joint.servo.id for joint in silent])
    if rate is None:
        remedy = "check the power switch, the supply and the cable"
        return [Finding.error(f"port {port.path}", f"silent: {names}", remedy)]
    text = f"the servos use {rate} bit/s, expected {port.baud}"
    remedy = "set bus.baud in robot.toml, or the servos' baud rate"
    return [Finding.error(f"port {port.path}", text, remedy)]


def _group(items: Sequence[Item]) -> list[list[Item]]:
    runs: list[list[Item]] = []
    for item in items:
        if runs and runs[-1][-1].end == item.address:
            runs[-1].append(item)
        else:
            runs.append([item])
    return runs
