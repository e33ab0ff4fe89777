"""The checkup of a robot on its bus before first torque: figures, findings, what to do."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.dynamixel import protocol2
from drivers.dynamixel.backend import READ_SHARE
from drivers.dynamixel.bus import BITS_PER_BYTE, DynamixelBus, Request
from drivers.dynamixel.configuration import list_eeprom_settings
from drivers.dynamixel.control_table import ControlTable
from drivers.dynamixel.cyclic_read import CyclicRead
from drivers.dynamixel.diagnostics import Finding, ServoFacts, Severity, name_all
from drivers.dynamixel.opencr import ImuSample, OpenCr
from drivers.dynamixel.port import read_latency_timer
from drivers.dynamixel.protocol2 import Span
from drivers.orientation_filter import GRAVITY
from drivers.safety_limits import DERATE_TEMPERATURE, MAX_TEMPERATURE
from drivers.service.session import Line, RobotBus
from robots import Joint, Robot
from robots.calibration import CALIBRATION_FILE

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
        self._look = Request.group(look)

    @property
    def bytes(self) -> int:
        """Return the bytes of one cycle on the wire, both ways, goals included."""
        group = Request.group(self._spans, fast=self._can_fast)
        goal = self._servos[0].table["goal_position"].address
        goals = protocol2.sync_write(goal, {servo.id: bytes(GOAL_BYTES) for servo in self._servos})
        asked = (group, self._look)
        return sum(len(q.frame) + q.answer_size for q in asked) + len(goals)

    def measure(self, rounds: int = ROUNDS) -> Latency:
        """Read as a cycle does, again and again, and take the time."""
        bus = self._bus
        group = CyclicRead(bus, self._spans, can_fast=self._can_fast)
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


BEST_TIMER = 1  # ms, the least that an adapter's latency timer can be
QUESTIONS = 2  # of a cycle that wait for answers
LEAST_FORCE, MOST_FORCE = 0.8 * GRAVITY, 1.2 * GRAVITY  # m/s², of a body at rest


@dataclass(frozen=True, kw_only=True)
class LineReport:
    """What was found of one port."""

    name: str
    path: str
    baud: int
    """[bit/s]"""
    latency_timer: int | None
    """How long the adapter holds back a short answer [ms]; None when it has no say."""
    cycle_bytes: int
    """Bytes of one cycle on the wire, both ways; 0 when no servo answered."""
    cycle_time: float
    """Time that they take there [s]."""
    latency: Latency | None
    """None when no servo answered."""


@dataclass(frozen=True, kw_only=True)
class HealthCheck:
    """All that was found of a robot."""

    robot: Robot
    servos: tuple[ServoFacts, ...]
    """Those that told all, in joint order."""
    findings: tuple[Finding, ...]
    """Errors first."""
    lines: tuple[LineReport, ...]
    imu: ImuSample | None
    torque: tuple[Joint, ...]
    """Joints that had torque, and have it still."""
    written: tuple[str, ...]
    """What had to be written in order to look, in words."""
    is_calibrated: bool
    """Tell whether the robot's folder holds a calibration."""

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Return what forbids to move."""
        return tuple(f for f in self.findings if f.severity is not Severity.WARNING)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Return what somebody should know."""
        return tuple(f for f in self.findings if f.severity is Severity.WARNING)


def examine(bus: RobotBus, rounds: int = ROUNDS) -> HealthCheck:
    """Examine a robot; its joints keep the torque that they have, and nothing is set."""
    robot, torque = bus.robot, bus.find_torque()
    told = bus.look()
    place = {joint.name: i for i, joint in enumerate(robot.joints)}
    servos = tuple(sorted(told.servos, key=lambda servo: place[servo.joint.name]))
    lines = [_examine_line(bus, line, servos, rounds) for line in bus.lines]
    board = bus.answering_board
    imu = board.read_imu() if board else None
    findings = [*told.findings, *_judge_torque(torque), *_judge_heat(servos)]
    findings += [f for line in lines for f in _judge_line(line, robot.control_period)]
    findings += [*_judge_imu(imu), *_judge_settings(servos), *_judge_calibration(robot)]
    return HealthCheck(
        robot=robot,
        servos=servos,
        findings=tuple(sorted(findings, key=lambda f: list(Severity).index(f.severity))),
        lines=tuple(lines),
        imu=imu,
        torque=torque,
        written=tuple(bus.written),
        is_calibrated=_is_calibrated(robot),
    )


def _examine_line(
    bus: RobotBus, line: Line, servos: Sequence[ServoFacts], rounds: int
) -> LineReport:
    here = [servo for servo in servos if servo.joint in line.joints]
    board, port, size, latency = bus.answering_board, line.bus.port, 0, None
    if here:
        is_here = board is not None and board.settings.port == line.name
        reading = CycleReading(line.bus, here, board if is_here else None)
        size, latency = reading.bytes, reading.measure(rounds)
    return LineReport(
        name=line.name,
        path=port.path,
        baud=port.baud,
        latency_timer=read_latency_timer(port.path),
        cycle_bytes=size,
        cycle_time=size * BITS_PER_BYTE / port.baud,
        latency=latency,
    )


# Findings -----------------------------------------------------------------------------------


def _judge_torque(joints: Sequence[Joint]) -> list[Finding]:
    if not joints:
        return []
    remedy = "hold the robot before a command connects to it: whatever moves it makes it limp first"
    return [Finding(Severity.WARNING, name_all(joints), "has torque", remedy)]


def _judge_heat(servos: Sequence[ServoFacts]) -> list[Finding]:
    findings, remedy = [], "let it cool down"
    for servo in servos:
        told = f"has {servo.temperature:.0f} °C"
        if servo.temperature > MAX_TEMPERATURE:
            text = f"{told}, allowed {MAX_TEMPERATURE:.0f} °C"
            findings.append(Finding(Severity.FAULT, servo.name, text, remedy))
        elif servo.temperature > DERATE_TEMPERATURE:
            text = f"{told}: it gets less torque from {DERATE_TEMPERATURE:.0f} °C on"
            findings.append(Finding(Severity.WARNING, servo.name, text, remedy))
    return findings


def _judge_settings(servos: Sequence[ServoFacts]) -> list[Finding]:
    """Tell which kept registers the driver is going to set, those alike together."""
    groups: dict[tuple[str, int, int], list[Joint]] = {}
    for servo in servos:
        for setting in list_eeprom_settings(servo):
            change = (setting.name, servo.registers[setting.name], setting.value)
            groups.setdefault(change, []).append(servo.joint)
    return [
        Finding(
            Severity.WARNING,
            name_all(joints) if len(joints) < len(servos) else f"all {len(servos)} servos",
            _describe_setting(name, found),
            f"nothing to do: the driver sets it to {wanted} when it first connects to move",
        )
        for (name, found, wanted), joints in groups.items()
    ]


def _describe_setting(name: str, value: int) -> str:
    told = f"{name.replace('_', ' ')} is {value}"
    return f"{told}, {2 * value} µs before each answer" if name == "return_delay_time" else told


def _judge_imu(sample: ImuSample | None) -> list[Finding]:
    if sample is None:
        return []
    force = float(np.linalg.norm(sample.accelerometer))
    if LEAST_FORCE <= force <= MOST_FORCE:
        return []
    text = (
        f"the accelerometer shows {force:.1f} m/s², at rest allowed {LEAST_FORCE:.1f} to "
        f"{MOST_FORCE:.1f} m/s²"
    )
    return [Finding(Severity.WARNING, "IMU", text, "let the robot rest; else restart its board")]


def _judge_line(line: LineReport, period: float) -> list[Finding]:
    port, findings = f"port {line.path}", list[Finding]()
    timer, allowed = line.latency_timer, READ_SHARE * period
    if timer is not None and timer > BEST_TIMER:
        severity = Severity.ERROR if QUESTIONS * timer * 1e-3 > allowed else Severity.WARNING
        text = f"its adapter holds answers back for up to {timer} ms, allowed {BEST_TIMER} ms"
        findings.append(Finding(severity, port, text, describe_timer_remedy(line.path)))
    if line.cycle_time > period:
        text = (
            f"at {line.baud} bit/s a cycle takes {line.cycle_time * 1e3:.1f} ms on the wire, "
            f"allowed {period * 1e3:.1f} ms"
        )
        remedy = "set the servos and bus.baud in robot.toml to a higher speed"
        findings.append(Finding(Severity.ERROR, port, text, remedy))
    return findings + _judge_latency(port, line.latency, allowed)


def _judge_latency(port: str, latency: Latency | None, allowed: float) -> list[Finding]:
    if latency is None:
        return []
    findings, limit = [], f"allowed {allowed * 1e3:.1f} ms"
    remedy = "set the adapter's latency timer to 1 ms, stop other programs, or use a faster bus"
    if latency.reading_median > allowed:
        text = f"reading takes {latency.reading_median * 1e3:.1f} ms of each cycle, {limit}"
        findings.append(Finding(Severity.ERROR, port, text, remedy))
    elif latency.reading_p99 > allowed:
        text = f"reading takes {latency.reading_p99 * 1e3:.1f} ms now and then, {limit}"
        findings.append(Finding(Severity.WARNING, port, text, remedy))
    if latency.lost or latency.damaged:
        text = (
            f"in {latency.rounds} readings {latency.lost} answers were lost and "
            f"{latency.damaged} damaged"
        )
        remedy = "check plugs and cables along the chain, ground above all"
        findings.append(Finding(Severity.WARNING, port, text, remedy))
    return findings


def describe_timer_remedy(path: str) -> str:
    """Tell how to make a USB adapter hand over answers at once."""
    name = Path(path).resolve().name
    return f"echo 1 | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer (docs, udev)"


def _judge_calibration(robot: Robot) -> list[Finding]:
    if _is_calibrated(robot):
        return []
    text = "no calibration: zeros and signs are those of the description"
    return [Finding(Severity.WARNING, f"robot '{robot.name}'", text, "run getup calibrate")]


def _is_calibrated(robot: Robot) -> bool:
    return (robot.folder / CALIBRATION_FILE).exists()
