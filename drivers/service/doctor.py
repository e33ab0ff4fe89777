"""Health check of a robot on its bus before first torque: timing, findings, remedies."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.dynamixel import protocol2
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.configuration import list_eeprom_settings
from drivers.dynamixel.cyclic_read import CyclicRead, GroupKind
from drivers.dynamixel.diagnostics import (
    READ_SHARE,
    Finding,
    ServoFacts,
    Severity,
    check_cycle_time,
    merge_findings,
    name_all,
)
from drivers.dynamixel.requests import GroupLayout, Request
from drivers.dynamixel.robot_ports import RobotPort
from drivers.imu.fusion import GRAVITY
from drivers.imu.source import POLL_STEP, ImuSample, ImuSource
from drivers.real_time_class import in_real_time_class
from drivers.safety_limits import DERATE_MARGIN, HOT_MARGIN
from drivers.serial_port import read_latency_timer
from drivers.service.session import RobotBus
from robots import Joint, Robot
from robots.description.calibration import CALIBRATION_FILE
from robots.servo import LimitMode

ROUNDS = 50  # reads that are timed
BEST_TIMER = 1  # ms, the least that an adapter's latency timer can be
REQUESTS = 2  # of a cycle that wait for replies
RATE_TIME = 0.5  # s over which an IMU's samples are counted
LEAST_RATE = 0.5  # samples a control cycle that a rise needs at least
LEAST_FORCE, MOST_FORCE = 0.8 * GRAVITY, 1.2 * GRAVITY  # m/s², of a body at rest


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Measured duration of a cycle's reads [s]."""

    rounds: int
    kind: str
    """How the group was read: fast sync read, sync read or bulk read."""
    group_median: float
    """Cyclic read: current, velocity and position of all servos."""
    group_p99: float
    reading_median: float
    """All reads of a cycle: the group, then the IMU and one slow value."""
    reading_p99: float
    return_delays: float
    """What all reads of a cycle wait in the servos as they are set up; the driver sets it to 0."""
    lost: int
    """Replies that did not come."""
    damaged: int
    """Replies whose CRC did not match."""


@dataclass(frozen=True, kw_only=True)
class PortReport:
    """Timing of one port."""

    name: str
    path: str
    baud: int
    """[bit/s]"""
    latency_timer: int | None
    """How long the adapter holds back a short reply [ms]; None if it has no timer."""
    cycle_bytes: int
    """Bytes of one cycle on the wire, both ways; 0 if no servo answered."""
    cycle_time: float
    """Their time there [s]."""
    latency: Latency | None
    """None if no servo answered."""


@dataclass(frozen=True, kw_only=True)
class HealthCheck:
    """Health of a robot."""

    robot: Robot
    servos: tuple[ServoFacts, ...]
    """Those whose registers could be read, in joint order."""
    findings: tuple[Finding, ...]
    """Errors first."""
    ports: tuple[PortReport, ...]
    imu: ImuSample | None
    imu_name: str
    """Name of the IMU in messages; empty if there is none."""
    imu_note: str
    """What is special about its samples, in words; empty for nothing."""
    imu_rate: float | None
    """Samples that it delivers [Hz]; None for a board, which is read with the servos."""
    torque: tuple[Joint, ...]
    """Joints that have torque."""
    written: tuple[str, ...]
    """What was written for the check, in words."""
    is_calibrated: bool
    """Whether the robot's folder holds a calibration."""
    is_prioritized: bool
    """Whether this user's control loop runs in the real-time class of the scheduler."""

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Return the findings that forbid motion."""
        return tuple(f for f in self.findings if f.severity is not Severity.WARNING)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Return the findings that do not."""
        return tuple(f for f in self.findings if f.severity is Severity.WARNING)


def examine(bus: RobotBus, rounds: int = ROUNDS) -> HealthCheck:
    """Check a robot's health; its joints keep their torque, and nothing is configured."""
    robot, torque = bus.robot, bus.find_torque()
    diagnostics = bus.diagnose()
    place = {joint.name: i for i, joint in enumerate(robot.joints)}
    servos = tuple(sorted(diagnostics.servos, key=lambda servo: place[servo.joint.name]))
    with in_real_time_class() as is_prioritized:  # as in the control loop
        ports = [_examine_port(bus, port, servos, rounds) for port in bus.ports]
    imu = bus.imu.measure() if bus.imu else None
    rate = measure_rate(bus.imu) if bus.imu and bus.imu is not bus.board and imu else None
    findings = [*diagnostics.findings, *_check_heat(servos)]
    if torque:
        remedy = "hold the robot before a command connects to it: connecting switches torque off"
        findings.append(Finding(Severity.WARNING, name_all(torque), "has torque", remedy))
    findings += [f for port in ports for f in check_port(port, robot.control_period)]
    findings += _check_imu(bus.imu, imu, rate, robot.control_period) if bus.imu else []
    findings += [*_check_settings(servos, robot.limit_by)]
    is_calibrated = (robot.folder / CALIBRATION_FILE).exists()
    if not is_calibrated:
        text = "no calibration: zeros and signs are those of the description"
        name, remedy = f"robot '{robot.name}'", "run getup calibrate"
        findings.append(Finding(Severity.WARNING, name, text, remedy))
    return HealthCheck(
        robot=robot,
        servos=servos,
        findings=tuple(sorted(findings, key=lambda f: list(Severity).index(f.severity))),
        ports=tuple(ports),
        imu=imu,
        imu_name=bus.imu.name if bus.imu else "",
        imu_note=bus.imu.note if bus.imu else "",
        imu_rate=rate,
        torque=torque,
        written=tuple(bus.written),
        is_calibrated=is_calibrated,
        is_prioritized=is_prioritized,
    )


def _examine_port(
    bus: RobotBus, port: RobotPort, servos: Sequence[ServoFacts], rounds: int
) -> PortReport:
    here = [servo for servo in servos if servo.joint in port.joints]
    wire, size, latency = port.bus.port, 0, None
    if here:
        board = bus.board
        is_here = board is not None and board.carries_imu and board.bus is port.bus
        imu = {board.id: board.span(0)} if board and is_here else {}
        supply = here[0].table.span("present_input_voltage", "present_temperature")
        background = port.bus.group(imu | {here[0].id: supply})
        size = _count_cycle_bytes(port.bus, here, background)
        latency = measure_latency(port.bus, here, background, rounds)
    return PortReport(
        name=port.name,
        path=wire.path,
        baud=wire.baud,
        latency_timer=read_latency_timer(wire.path),
        cycle_bytes=size,
        cycle_time=size * port.bus.byte_time,
        latency=latency,
    )


# Timing -------------------------------------------------------------------------------------


def measure_latency(
    bus: DynamixelBus, servos: Sequence[ServoFacts], background: Request, rounds: int
) -> Latency:
    """Measure how long a cycle's reads take: of some servos, at least one, then the background."""
    cyclic = CyclicRead(bus, servos)
    kind, lost, damaged = cyclic.kind, bus.statistics.lost, bus.statistics.damaged
    times = np.zeros((rounds, 2))
    for row in times:
        start = time.monotonic()
        cyclic.begin()
        cyclic.collect(math.inf)
        row[0] = time.monotonic() - start
        bus.request(background)
        row[1] = time.monotonic() - start
    medians, p99s = np.percentile(times, (50, 99), axis=0)
    return Latency(
        rounds=rounds,
        kind=kind.value,
        group_median=float(medians[0]),
        group_p99=float(p99s[0]),
        reading_median=float(medians[1]),
        reading_p99=float(p99s[1]),
        return_delays=_sum_delays(servos, kind),
        lost=bus.statistics.lost - lost,
        damaged=bus.statistics.damaged - damaged,
    )


def _sum_delays(servos: Sequence[ServoFacts], kind: GroupKind) -> float:
    """Sum the return delays of a group read, and of the first servo in the background [s]."""
    delays = [
        servo.registers["return_delay_time"] * servo.table["return_delay_time"].scale
        for servo in servos
    ]
    group = min(delays) if kind is GroupKind.FAST else sum(delays)
    return group + delays[0]


def _count_cycle_bytes(bus: DynamixelBus, servos: Sequence[ServoFacts], background: Request) -> int:
    """Count the bytes of a cycle on the wire, both ways: cyclic and background read, goals."""
    fast = all(servo.supports_fast_read for servo in servos)
    spans = {servo.id: GroupLayout.of(servo.table).span for servo in servos}
    group = bus.group(spans, fast=fast)
    goal = servos[0].table["goal_position"]
    goals = protocol2.sync_write(goal.address, {servo.id: bytes(goal.size) for servo in servos})
    both = sum(request.size + request.reply_size for request in (group, background))
    return both + len(bus.wire.encode(goals))


# Findings -----------------------------------------------------------------------------------


def _check_heat(servos: Sequence[ServoFacts]) -> list[Finding]:
    findings, remedy = [], "let it cool down"
    for servo in servos:
        measured = f"has {servo.temperature:.0f} °C"
        limit = min(servo.to_si("temperature_limit"), servo.joint.servo.model.temperature_limit)
        if servo.temperature > limit - HOT_MARGIN:
            text = f"{measured}, expected at most {limit - HOT_MARGIN:.0f} °C"
            findings.append(Finding(Severity.FAULT, servo.name, text, remedy))
        elif servo.temperature > limit - DERATE_MARGIN:
            text = f"{measured}: it gets less torque from {limit - DERATE_MARGIN:.0f} °C on"
            findings.append(Finding(Severity.WARNING, servo.name, text, remedy))
    return findings


def _check_settings(servos: Sequence[ServoFacts], limit_by: LimitMode) -> list[Finding]:
    """List the EEPROM items that the driver is going to set, equal ones together."""
    found = [
        Finding(
            Severity.WARNING,
            servo.name,
            _describe_setting(name, servo.registers[name]),
            f"nothing to do: the driver sets it to {wanted} when it first connects to move",
        )
        for servo in servos
        for name, wanted in list_eeprom_settings(servo, limit_by).items()
    ]
    return merge_findings(found, [servo.joint for servo in servos])


def _describe_setting(name: str, value: int) -> str:
    text = f"{name.replace('_', ' ')} is {value}"
    return f"{text}, {2 * value} µs before each reply" if name == "return_delay_time" else text


def measure_rate(imu: ImuSource) -> float:
    """Count the samples of an IMU on its own line [Hz]."""
    count, until = 0, time.monotonic() + RATE_TIME
    while (now := time.monotonic()) < until:
        imu.request(now)
        count += imu.poll() is not None
        time.sleep(POLL_STEP)
    return count / RATE_TIME


def _check_imu(
    imu: ImuSource, sample: ImuSample | None, rate: float | None, period: float
) -> list[Finding]:
    if sample is None:
        remedy = "check its power, its cable, and how robot.toml describes it"
        return [Finding.error(imu.name, "sends no samples", remedy)]
    findings, least = list[Finding](), LEAST_RATE / period
    force = float(np.linalg.norm(sample.accelerometer))
    if not LEAST_FORCE <= force <= MOST_FORCE:
        text = (
            f"the accelerometer shows {force:.1f} m/s², expected at rest {LEAST_FORCE:.1f} to "
            f"{MOST_FORCE:.1f} m/s²"
        )
        remedy = "let the robot rest; else restart its board"
        findings.append(Finding(Severity.WARNING, "IMU", text, remedy))
    if rate is not None and rate < least:
        text = f"delivers {rate:.0f} samples a second, expected at least {least:.0f}"
        remedy = "raise its rate or its baud rate"
        findings.append(Finding(Severity.WARNING, imu.name, text, remedy))
    if rate is not None and imu.damaged:
        text, remedy = f"{imu.damaged} damaged messages", "check its cable and its baud rate"
        findings.append(Finding(Severity.WARNING, imu.name, text, remedy))
    return findings


def check_port(report: PortReport, period: float) -> list[Finding]:
    """Judge a port by its adapter, its cycle time and its latency; the period is in s."""
    port, findings = f"port {report.path}", list[Finding]()
    timer, limit = report.latency_timer, READ_SHARE * period
    if timer is not None and timer > BEST_TIMER:
        severity = Severity.ERROR if REQUESTS * timer * 1e-3 > limit else Severity.WARNING
        text = f"its adapter holds replies back for up to {timer} ms, expected {BEST_TIMER} ms"
        findings.append(Finding(severity, port, text, describe_timer_remedy(report.path)))
    findings += check_cycle_time(report.path, report.baud, report.cycle_time, period)
    return findings + _check_latency(port, report.latency, limit)


def _check_latency(port: str, latency: Latency | None, limit: float) -> list[Finding]:
    if latency is None:
        return []
    findings, expected = [], f"expected at most {limit * 1e3:.1f} ms"
    remedy = "set the adapter's latency timer to 1 ms, stop other programs, or use a faster bus"
    median = latency.reading_median - latency.return_delays
    p99 = latency.reading_p99 - latency.return_delays
    if median > limit:
        text = f"reading takes {median * 1e3:.1f} ms of each cycle, {expected}"
        findings.append(Finding.error(port, text, remedy))
    elif p99 > limit:
        text = f"reading takes up to {p99 * 1e3:.1f} ms, {expected}"
        findings.append(Finding(Severity.WARNING, port, text, remedy))
    if latency.lost or latency.damaged:
        text = (
            f"in {latency.rounds} reads {latency.lost} replies were lost and "
            f"{latency.damaged} damaged"
        )
        remedy = "check plugs and cables along the chain, ground above all"
        findings.append(Finding(Severity.WARNING, port, text, remedy))
    return findings


def describe_timer_remedy(path: str) -> str:
    """Describe how to make a USB adapter deliver replies at once."""
    name = Path(path).resolve().name
    return f"echo 1 | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer (docs, udev)"
