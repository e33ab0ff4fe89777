"""The look at a robot's bus before anything moves: who is there, and all that is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import (
    BAUD_RATES,
    ControlTable,
    HardwareError,
    Item,
    UnknownModelError,
    table_for,
)
from drivers.dynamixel.protocol2 import Span, Status
from drivers.errors import DriverError
from robots import Joint, Robot
from robots.servo import PWM_FULL_SCALE, TICKS_PER_TURN

TRIES = 3
MIN_FIRMWARE = 38  # the first with a bus watchdog (e-manual, XM430-W350)
FIRST_FREE_ID = 253  # from here on a secondary id means none
REVERSED = 1  # bit of the drive mode
OUTSIDE_RANGE = 0.1  # rad that a joint may lie beyond its range without a word
# On the wire in a cycle: for each servo its id twice, its goal and a plain status; once the
# frames around them, and the question for IMU and slow values with its answers.
SERVO_BYTES, CYCLE_BYTES = 26, 94
FAR_RATES = tuple(reversed(BAUD_RATES[1:]))
"""Speeds at which to look for servos that are silent at the right one [bit/s]."""


class Severity(Enum):
    """What a finding means for the robot."""

    ERROR = "error"
    """It must not move like this, and cannot be connected to."""
    FAULT = "fault"
    """It can be connected to, but stays limp until somebody mends this."""
    WARNING = "warning"
    """It may move, but somebody should know."""


@dataclass(frozen=True)
class Finding:
    """Something that is not as it should be."""

    severity: Severity
    device: str
    """Who: "joint 'r_knee' (id 13)"."""
    text: str
    remedy: str
    """What to do about it."""

    def __str__(self) -> str:
        return f"{self.device}: {self.text}; {self.remedy}"


class DiagnosticsError(DriverError):
    """A robot's bus is not fit to move the robot; tells all that is wrong at once."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        super().__init__(" | ".join(map(str, findings)))
        self.findings = tuple(findings)


@dataclass(frozen=True, kw_only=True)
class ServoFacts:
    """What a servo told of itself."""

    joint: Joint
    table: ControlTable
    firmware: int
    registers: Mapping[str, int]
    """Values of the items that were read, by name."""

    @property
    def id(self) -> int:
        """Return the servo's id."""
        return self.joint.servo.id

    @property
    def name(self) -> str:
        """Return how to call it in a message."""
        return name_of(self.joint)

    @property
    def supports_fast_read(self) -> bool:
        """Tell whether it answers fast reads."""
        return self.table.supports_fast_read(self.firmware)

    @property
    def angle(self) -> float:
        """Return the joint angle [rad]."""
        return self.joint.servo.to_rad(self.registers["present_position"])

    @property
    def voltage(self) -> float:
        """Return the supply [V]."""
        return self._scaled("present_input_voltage")

    @property
    def temperature(self) -> float:
        """Return the temperature [°C]."""
        return self._scaled("present_temperature")

    def _scaled(self, name: str) -> float:
        return self.registers[name] * self.table[name].scale


@dataclass(frozen=True)
class Diagnostics:
    """The result of a look at a bus."""

    servos: tuple[ServoFacts, ...]
    """Those that told all, in joint order."""
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Return what forbids to move."""
        return tuple(f for f in self.findings if f.severity is Severity.ERROR)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Return what somebody should know."""
        return tuple(f for f in self.findings if f.severity is Severity.WARNING)


AUDITED = (
    "return_delay_time",
    "drive_mode",
    "operating_mode",
    "secondary_id",
    "homing_offset",
    "temperature_limit",
    "max_voltage_limit",
    "min_voltage_limit",
    "pwm_limit",
    "velocity_limit",
    "max_position_limit",
    "min_position_limit",
    "startup_configuration",
    "shutdown",
    "torque_enable",
    "status_return_level",
    "hardware_error_status",
    "position_d_gain",
    "position_i_gain",
    "position_p_gain",
    "goal_position",
    "present_position",
    "present_input_voltage",
    "present_temperature",
)


def audit(bus: DynamixelBus, joints: Iterable[Joint]) -> Diagnostics:
    """Look at the servos of some joints, change nothing, and tell all that is wrong."""
    servos: list[ServoFacts] = []
    findings: list[Finding] = []
    silent: list[Joint] = []
    for joint in joints:
        heard = bus.statistics.bytes_in
        pong = bus.ping(joint.servo.id, TRIES)
        if pong is None and bus.statistics.bytes_in > heard:
            findings.append(_doubled(joint))
        elif pong is None:
            silent.append(joint)
        else:
            servo = _examine(bus, joint, pong, findings)
            if servo is not None:
                servos.append(servo)
                findings += judge(servo)
    if silent:
        findings[:0] = _explain_silence(bus, silent, anybody=bool(servos or findings))
    return Diagnostics(tuple(servos), tuple(findings))


def read_items(
    bus: DynamixelBus, device: int, table: ControlTable, names: Iterable[str]
) -> dict[str, int] | None:
    """Read items of a servo, neighbors together; ``None`` when it did not tell all.

    Items that its table does not have are left out.
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


def judge(servo: ServoFacts) -> list[Finding]:
    """List what is wrong with a servo that answers, as far as it cannot just be set right."""
    told, model = servo.registers, servo.joint.servo.model
    found: list[Finding] = []

    def error(text: str, remedy: str) -> None:
        found.append(Finding(Severity.ERROR, servo.name, text, remedy))

    def warn(text: str, remedy: str) -> None:
        found.append(Finding(Severity.WARNING, servo.name, text, remedy))

    if servo.firmware < MIN_FIRMWARE:
        error(
            f"firmware {servo.firmware} has no bus watchdog, allowed {MIN_FIRMWARE} or newer",
            "update it with DYNAMIXEL Wizard",
        )
    if alert := HardwareError(told["hardware_error_status"]):
        names = " and ".join(str(bit.name).lower() for bit in alert)
        # The guard keeps such a robot limp; whoever may reboot the servo has to reach it first.
        text, remedy = f"has switched itself off: {names}", "let it cool down and restart it"
        found.append(Finding(Severity.FAULT, servo.name, text, remedy))
    if not model.min_voltage <= servo.voltage <= model.max_voltage:
        error(
            f"supply is {servo.voltage:.1f} V, allowed {model.min_voltage:.1f} to "
            f"{model.max_voltage:.1f} V",
            "charge or change the battery",
        )
    if told["drive_mode"] & REVERSED:
        error(
            f"drive mode is {told['drive_mode']}, reversed: it would turn the wrong way",
            "set its drive mode to 0, then calibrate the joint",
        )
    if told["secondary_id"] < FIRST_FREE_ID:
        error(f"also obeys the secondary id {told['secondary_id']}", "set its secondary id to 255")
    if told["homing_offset"]:
        warn(
            f"homing offset is {told['homing_offset']} ticks",
            "fine if the joint was calibrated with it, else set it to 0",
        )
    if told["pwm_limit"] < PWM_FULL_SCALE:
        warn(
            f"PWM limit is {told['pwm_limit']} of {PWM_FULL_SCALE}: it has less torque",
            f"set it to {PWM_FULL_SCALE} unless that is meant",
        )
    if told.get("startup_configuration", 0) & 1:
        warn("takes torque by itself at power-up", "set its startup configuration to 0")
    expected = HardwareError.OVERHEATING | HardwareError.OVERLOAD
    if told["shutdown"] & expected != expected:
        warn(
            f"shutdown is {told['shutdown']}: overheating or overload would not stop it",
            "set its shutdown to 52",
        )
    joint, angle = servo.joint, servo.angle
    if not joint.lower - OUTSIDE_RANGE <= angle <= joint.upper + OUTSIDE_RANGE:
        warn(
            f"stands at {angle:+.2f} rad, outside [{joint.lower:+.2f}, {joint.upper:+.2f}] rad",
            "move it back by hand, or calibrate it",
        )
    ends = sorted(joint.servo.to_ticks(limit) for limit in (joint.lower, joint.upper))
    if ends[0] < 0 or ends[1] >= TICKS_PER_TURN:
        warn(
            f"its range needs ticks {ends[0]} to {ends[1]}, allowed 0 to {TICKS_PER_TURN - 1}",
            "mount its horn so that the range lies within one turn, and calibrate it",
        )
    return found


def check_model(joint: Joint, table: ControlTable) -> list[Finding]:
    """Tell when a servo is not of the model that the robot's description names."""
    wanted = joint.servo.model.name
    if table.model == wanted:
        return []
    text = f"is a {table.model}, allowed {wanted}"
    return [Finding(Severity.ERROR, name_of(joint), text, "change the servo or robot.toml")]


def find_far_rate(bus: DynamixelBus, devices: Sequence[int]) -> int | None:
    """Look for servos at other speeds; return the one at which one answers [bit/s].

    The port is left at its own speed.
    """
    own = bus.port.baud
    try:
        for rate in FAR_RATES:
            if rate == own:
                continue
            try:
                bus.port.set_baud(rate)
            except DriverError:
                continue  # not every adapter has every speed
            if any(bus.ping(device) is not None for device in devices[:3]):
                return rate
    finally:
        bus.port.set_baud(own)
    return None


def check_speed(bus: DynamixelBus, count: int, period: float) -> list[Finding]:
    """Tell when a bus is too slow for a control period [s] of so many servos.

    On such a bus every value would come too late, and nothing else would be wrong.
    """
    needed = (CYCLE_BYTES + count * SERVO_BYTES) * bus.byte_time
    if needed <= period:
        return []
    text = (
        f"at {bus.port.baud} bit/s a cycle of {count} servos takes {needed * 1e3:.1f} ms, "
        f"allowed {period * 1e3:.1f} ms"
    )
    remedy = "set the servos and bus.baud in robot.toml to a higher speed"
    return [Finding(Severity.ERROR, f"port {bus.port.path}", text, remedy)]


def name_of(joint: Joint) -> str:
    """Return how to call a joint's servo in a message."""
    return f"joint '{joint.name}' (id {joint.servo.id})"


def name_all(joints: Iterable[Joint]) -> str:
    """Return how to call several."""
    return ", ".join(name_of(joint) for joint in joints)


def list_doubled_ids(robot: Robot) -> list[Finding]:
    """Tell which ids the robot's description gives to two joints, or to a joint and the board."""
    users: dict[int, list[str]] = {}
    for joint in robot.joints:
        users.setdefault(joint.servo.id, []).append(joint.name)
    if robot.bus is not None and robot.bus.board is not None:
        users.setdefault(robot.bus.board.id, []).append("the board")
    return [
        Finding(Severity.ERROR, f"id {i}", f"belongs to {' and '.join(who)}", "edit robot.toml")
        for i, who in users.items()
        if len(who) > 1
    ]


def _examine(
    bus: DynamixelBus, joint: Joint, pong: Status, findings: list[Finding]
) -> ServoFacts | None:
    number, firmware = int.from_bytes(pong.data[:2], "little"), pong.data[2]
    try:
        table = table_for(number, firmware)
    except UnknownModelError as unknown:
        findings.append(
            Finding(Severity.ERROR, name_of(joint), str(unknown), "change the servo or robot.toml")
        )
        return None
    if found := check_model(joint, table):
        findings += found
        return None
    before = replace(bus.statistics)
    registers = read_items(bus, joint.servo.id, table, AUDITED)
    if registers is None:
        since = bus.statistics - before
        if since.damaged or since.stale:
            findings.append(_doubled(joint))
        else:
            text = "answers a ping but does not tell its registers"
            findings.append(
                Finding(Severity.ERROR, name_of(joint), text, "check its cable and power")
            )
        return None
    return ServoFacts(joint=joint, table=table, firmware=firmware, registers=registers)


def _doubled(joint: Joint) -> Finding:
    return Finding(
        Severity.ERROR,
        name_of(joint),
        "answers are garbled, as by two servos of one id",
        "unplug one at a time and give each an id of its own; else check the cable",
    )


def _explain_silence(bus: DynamixelBus, silent: Sequence[Joint], *, anybody: bool) -> list[Finding]:
    who, port = name_all(silent), bus.port
    if anybody:
        remedy = "check its cable, its power and its id (getup scan)"
        return [Finding(Severity.ERROR, who, "silent", remedy)]
    rate = find_far_rate(bus, [joint.servo.id for joint in silent])
    if rate is None:
        remedy = "check the robot's power switch, the battery and the cable"
        return [Finding(Severity.ERROR, f"port {port.path}", f"silent: {who}", remedy)]
    text = f"the servos talk at {rate} bit/s, not {port.baud}"
    remedy = "set bus.baud in robot.toml, or the servos' baud rate"
    return [Finding(Severity.ERROR, f"port {port.path}", text, remedy)]


def _group(items: Sequence[Item]) -> list[list[Item]]:
    """Gather items without a gap between them."""
    runs: list[list[Item]] = []
    for item in items:
        if runs and runs[-1][-1].end == item.address:
            runs[-1].append(item)
        else:
            runs.append([item])
    return runs
