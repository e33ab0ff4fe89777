"""Brings a robot from open ports to first torque: diagnoses, configures, measures once."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from drivers.dynamixel.board import Board, check_board
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.cyclic_read import count_reads
from drivers.dynamixel.diagnostics import (
    READ_SHARE,
    Diagnostics,
    DiagnosticsError,
    Finding,
    ServoFacts,
    Severity,
    check_cycle_time,
    diagnose,
    find_duplicate_ids,
    name_all,
    name_of,
)
from drivers.dynamixel.robot_ports import find_bus, using_margin
from drivers.dynamixel.servo_chain import ServoChain
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.whole_turns import OUTSIDE_RANGE, WholeTurns
from drivers.errors import SetupError
from drivers.imu.source import ImuError, ImuSample, ImuSource
from drivers.serial_port import read_latency
from robots import BusSettings, Joint, Robot
from robots.arguments import expect
from robots.bench import choose_period
from robots.imu import IMU_PORT
from robots.quaternion import Array
from robots.servo import LimitMode
from robots.torque_limit import check_mode

SETUP_MARGIN = 0.03  # s that a reply may take where no cycle is waiting
BOOT_TIME = 3.0  # s until servos reply after power-up or reboot; they take 0.3 s
BOOT_MARGIN = 0.01  # s to wait for each reply meanwhile
# On the wire in a cycle: for each servo its id twice, its goal and a plain status; once the
# frames around them, and the background read with its replies.
SERVO_BYTES, CYCLE_BYTES = 26, 94
GROUP_CYCLE = 2  # reads of a cycle that reads all servos at once: these, and the background
FIRST_READS = 10  # tries to read a first value of every joint


def name_devices(robot: Robot, ports: Mapping[str, str] | str) -> Mapping[str, str]:
    """Return the device of each port by its name; that of the only one may be given alone."""
    expect("robot", robot, Robot, "a Robot, e.g. load_robot('op3')")
    names = list(robot.bus.ports) if robot.bus else []
    if isinstance(ports, str) and len(names) == 1:
        return {names[0]: ports}
    example = ", ".join(f"'{name}': '/dev/ttyUSB{i}'" for i, name in enumerate(names))
    expect("ports", ports, Mapping, f"a device by the name of its port, e.g. {{{example}}}")
    return cast("Mapping[str, str]", ports)


def check_description(robot: Robot, ports: Mapping[str, str], without_imu: bool) -> BusSettings:
    """Return the bus of a robot whose description fits its ports; raise `SetupError` else."""
    bus = find_bus(robot)
    if robot.imu_kind is None and not without_imu:
        raise SetupError(
            f"robot '{robot.name}' has no IMU: add an [imu] table, or a [bus.board] table for one "
            "on the servo bus, to its robot.toml, or play a motion with --without-imu"
        )
    if robot.imu_kind is not None and without_imu:
        raise SetupError(
            f"robot '{robot.name}' has an IMU ({robot.imu_kind}), expected a robot without one, or "
            "without_imu=False"
        )
    wanted, has_own_line = list(bus.ports), robot.imu is not None and robot.imu.has_own_line
    if sorted(set(ports) - ({IMU_PORT} if has_own_line else set())) != sorted(wanted):
        raise SetupError(
            f"robot '{robot.name}' has the ports {', '.join(wanted)}; "
            f"devices were named for: {', '.join(ports) or 'none'}"
        )
    return bus


def check_limit_mode(robot: Robot, by: LimitMode) -> LimitMode:
    """Return how a robot's servos are to limit torque; raise `SetupError` if they cannot."""
    if by == "ideal":
        raise SetupError("torque limit is by 'ideal', which no servo can, expected another mode")
    try:
        check_mode(robot, by)
    except ValueError as error:
        raise SetupError(str(error)) from error
    return by


def await_servos(servos: Iterable[tuple[DynamixelBus, Joint]]) -> None:
    """Wait for servos that have just been powered; `diagnose` reports those that stay silent."""
    until = time.monotonic() + BOOT_TIME
    missing = list(servos)
    with using_margin([bus for bus, _ in missing], BOOT_MARGIN):
        while missing and time.monotonic() < until:
            missing = [(bus, joint) for bus, joint in missing if not bus.ping(joint.servo.id)]


def diagnose_robot(
    robot: Robot, chains: Sequence[ServoChain], imu: ImuSource | None, period: float | None
) -> Diagnostics:
    """Power the servos, switch their torque off, open the IMU, and find all problems.

    The ports are open; a robot may be without an IMU. ``period`` is the control period that they
    must keep [s], ``None`` if time is simulated.
    """
    findings = find_duplicate_ids(robot)
    for chain in chains:
        if period is not None:
            findings += check_period(chain.bus, chain.joints, period)
    for chain in chains:
        found = check_board(chain.board) if chain.board else []
        findings += found
        if found and chain.board and chain.board.settings.powers_servos:
            return Diagnostics((), tuple(findings))  # servos without power are silent anyway
    findings += open_imu(imu) if imu else []
    await_servos((chain.bus, joint) for chain in chains for joint in chain.joints)
    servos = []
    for chain in chains:
        chain.writer.write_all("torque_enable", 0)
        chain.unmute()
        diagnostics = diagnose(chain.bus, chain.joints)
        servos += diagnostics.servos
        findings += diagnostics.findings
    return locate(robot, Diagnostics(tuple(servos), tuple(findings)))


def locate(robot: Robot, diagnosed: Diagnostics) -> Diagnostics:
    """Add the angles of a robot's joints to a diagnosis, and joints that may be elsewhere."""
    register, known = np.zeros(robot.n, dtype=int), np.zeros(robot.n, dtype=bool)
    rows = [robot.joint_names.index(servo.joint.name) for servo in diagnosed.servos]
    register[rows] = [servo.registers["present_position"] for servo in diagnosed.servos]
    known[rows] = True
    angles = WholeTurns(robot).find_angles(register, known)
    servos, findings = list[ServoFacts](), list(diagnosed.findings)
    for servo, row in zip(diagnosed.servos, rows, strict=True):
        here = float(angles[row][0]) if row in angles else None
        servos.append(replace(servo, angle=here))
        findings += _check_place(robot.joints[row], angles[row]) if row in angles else []
    return Diagnostics(tuple(servos), tuple(findings))


def _check_place(joint: Joint, angles: Array) -> list[Finding]:
    """List what is wrong with the possible angles of a joint [rad], likeliest first, (k,)."""
    here = angles[0]
    if not joint.lower - OUTSIDE_RANGE <= here <= joint.upper + OUTSIDE_RANGE:
        text = f"is at {here:+.2f} rad, outside [{joint.lower:+.2f}, {joint.upper:+.2f}] rad"
        remedy = "move it back by hand, or calibrate it"
        return [Finding(Severity.WARNING, name_of(joint), text, remedy)]
    elsewhere = sorted({f"{a:+.2f}" for a in angles[1:] if abs(a - here) > OUTSIDE_RANGE})
    if not elsewhere:
        return []
    text = f"is taken to be at {here:+.2f} rad, may be at {' or '.join(elsewhere)}: turns apart"
    remedy = "if it is not there, turn it to its middle by hand and connect again"
    return [Finding(Severity.WARNING, name_of(joint), text, remedy)]


def check_period(bus: DynamixelBus, joints: Sequence[Joint], period: float) -> list[Finding]:
    """Check that a cycle with the servos of some joints fits a control period [s]."""
    port, count = bus.port, len(joints)
    reads = count_reads([table_named(joint.servo.model.name) for joint in joints])
    duration = (CYCLE_BYTES + count * SERVO_BYTES) * bus.byte_time
    latency = read_latency(port.path) if reads > GROUP_CYCLE else 0.0
    if not latency or duration + reads * latency <= READ_SHARE * period:
        return check_cycle_time(port.path, port.baud, duration, period)
    text = (
        f"a cycle takes {duration * 1e3:.1f} ms on the wire and waits {reads * latency * 1e3:.1f} "
        "ms for the adapter, for its servos are read one by one: expected at most "
        f"{READ_SHARE * period * 1e3:.1f} ms of a period of {period * 1e3:.1f} ms"
    )
    enough = choose_period(count, port.baud, latency, reads)
    remedy = f"set control_period in robot.toml to {enough:g}"
    return [Finding.error(f"port {port.path}", text, remedy)]


def open_imu(imu: ImuSource) -> list[Finding]:
    """Open an IMU that has a line of its own; a board is checked with its bus."""
    if isinstance(imu, Board):
        return []
    try:
        imu.open()
    except ImuError as error:
        return [Finding.error(error.name, error.text, error.remedy)]
    return []


def configure_servos(found: Diagnostics, chains: Sequence[ServoChain], states: ServoStates) -> None:
    """Set the registers of all servos; raise `DiagnosticsError` with those that do not confirm."""
    states.update_from_facts(found.servos)
    servos = {states.row(servo.id): servo for servo in found.servos}
    failures: list[Finding] = []
    for chain in chains:
        chain.set_facts({row: servos[row] for row in chain.rows.tolist()})
        for row in chain.rows.tolist():
            if failure := chain.configure(row):
                remedy = "check its cable and power, then connect again"
                failures.append(Finding.error(servos[row].name, failure, remedy))
            else:
                states.note_ready(row)
    if failures:
        raise DiagnosticsError(failures)
    for chain in chains:
        chain.bus.return_delay = 0.0


def measure_once(
    chains: Sequence[ServoChain], imu: ImuSource | None, states: ServoStates, now: float
) -> ImuSample | None:
    """Read every joint and the IMU once, so that every value comes from a measurement.

    Without an IMU, no sample is returned.
    """
    for _ in range(FIRST_READS):
        for chain in chains:
            chain.begin_cyclic()
            chain.collect_cyclic(np.inf)
            chain.apply_cyclic(states, now)
        if np.isfinite(states.stamp).all():
            break
    findings = []
    silent = [
        joint
        for chain in chains
        for joint, row in zip(chain.joints, chain.rows, strict=True)
        if not np.isfinite(states.stamp[row])
    ]
    if silent:
        text = "set up, but silent when its position is read"
        remedy = "check cables and power along the chain"
        findings.append(Finding.error(name_all(silent), text, remedy))
    sample = imu.measure() if imu else None
    if imu is not None and sample is None:
        remedy = "check its power and its cable, and how robot.toml describes it"
        findings.append(Finding.error(imu.name, "its IMU cannot be read", remedy))
    if findings:
        raise DiagnosticsError(findings)
    return sample
