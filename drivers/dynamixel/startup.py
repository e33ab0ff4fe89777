"""From opened ports to a robot that may move: look at everybody, set them up, measure once."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from drivers.dynamixel.bus import FACTORY_RETURN_DELAY, DynamixelBus
from drivers.dynamixel.configuration import ALL_ANSWERED
from drivers.dynamixel.diagnostics import (
    Diagnostics,
    DiagnosticsError,
    Finding,
    Severity,
    audit,
    check_speed,
    list_doubled_ids,
    name_all,
)
from drivers.dynamixel.opencr import ImuSample, blame_board, check_board
from drivers.dynamixel.port import PortError
from drivers.dynamixel.servo_chain import ServoChain
from drivers.dynamixel.servo_states import ServoStates
from drivers.errors import SetupError
from robots import Joint, Robot

SETUP_MARGIN = 0.03  # s that an answer may take where no cycle is waiting
BOOT_TIME = 3.0  # s until servos answer that were given power or rebooted; they take 0.3 s
BOOT_MARGIN = 0.01  # s to wait for each answer meanwhile
FIRST_READS = 10  # tries to get a first value of every joint


def open_ports(lines: Sequence[ServoChain]) -> None:
    """Open every line's port.

    Raises:
        SetupError: when some do not open; a `PortError` when it is one.
    """
    errors: list[PortError] = []
    for line in lines:
        line.bus.return_delay = FACTORY_RETURN_DELAY
        try:
            line.bus.port.open()
        except PortError as error:
            errors.append(error)
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise SetupError("; ".join(map(str, errors)))


def look_at_all(robot: Robot, lines: Sequence[ServoChain], period: float | None) -> Diagnostics:
    """Power the servos, release them, and find all that is wrong.

    Args:
        robot: Robot as described.
        lines: Its ports, open.
        period: Control period that the buses must keep [s]; ``None`` when time waits.
    """
    findings = list_doubled_ids(robot)
    if period is not None:
        for line in lines:
            findings += check_speed(line.bus, len(line.joints), period)
    for line in lines:
        found = check_board(line.board) if line.board else []
        findings += found
        if found and line.board and line.board.settings.powers_servos:
            return Diagnostics((), tuple(findings))  # servos without power are silent anyway
    await_servos(lines)
    servos = []
    for line in lines:
        line.writer.ask_for_answers(ALL_ANSWERED)
        line.writer.release_all()
        told = audit(line.bus, line.joints)
        servos += told.servos
        findings += told.findings
    return Diagnostics(tuple(servos), tuple(findings))


def set_up_all(found: Diagnostics, lines: Sequence[ServoChain], bank: ServoStates) -> None:
    """Set the registers of all servos that an audit found.

    Raises:
        AuditError: naming all servos that do not confirm.
    """
    bank.adopt(found.servos)
    servos = {bank.row(servo.id): servo for servo in found.servos}
    faults: list[Finding] = []
    for line in lines:
        line.adopt({row: servos[row] for row in line.rows.tolist()})
        for row in line.rows.tolist():
            if fault := line.configure(row):
                remedy = "check its cable and power, then connect again"
                faults.append(Finding(Severity.ERROR, servos[row].name, fault, remedy))
            else:
                bank.note_ready(row)
    if faults:
        raise DiagnosticsError(faults)
    for line in lines:
        line.bus.return_delay = 0.0


def measure_first(lines: Sequence[ServoChain], bank: ServoStates, now: float) -> ImuSample:
    """Take one value of every joint, and one of the IMU: none is ever made up.

    Raises:
        AuditError: naming everybody who stays silent.
    """
    for _ in range(FIRST_READS):
        for line in lines:
            line.ask_group()
            line.collect_group(np.inf)
            line.take_group(bank, now)
        if np.isfinite(bank.stamp).all():
            break
    faults = []
    silent = [j for line in lines for j, row in line.places if not np.isfinite(bank.stamp[row])]
    if silent:
        text = "set up, but silent when asked for a position"
        remedy = "check cables and power along the chain"
        faults.append(Finding(Severity.ERROR, name_all(silent), text, remedy))
    board = next(line.board for line in lines if line.board)
    sample = board.read_imu()
    if sample is None:
        faults.append(blame_board(board.settings, "does not tell its IMU"))
    if faults or sample is None:
        raise DiagnosticsError(faults)
    return sample


class PortOfJoints(Protocol):
    """A bus and the joints on it."""

    @property
    def bus(self) -> DynamixelBus:
        """Return the bus."""
        ...

    @property
    def joints(self) -> Sequence[Joint]:
        """Return the joints on it."""
        ...


@contextmanager
def margin(lines: Sequence[PortOfJoints], value: float) -> Iterator[None]:
    """Wait for answers as long as said [s], inside the block."""
    before = [line.bus.answer_margin for line in lines]
    for line in lines:
        line.bus.answer_margin = value
    try:
        yield
    finally:
        for line, was in zip(lines, before, strict=True):
            line.bus.answer_margin = was


def await_servos(lines: Sequence[PortOfJoints]) -> None:
    """Wait for servos that have just been given power; who stays silent is the audit's."""
    until = time.monotonic() + BOOT_TIME
    missing = [(line.bus, joint.servo.id) for line in lines for joint in line.joints]
    with margin(lines, BOOT_MARGIN):
        while missing and time.monotonic() < until:
            missing = [(bus, device) for bus, device in missing if not bus.ping(device)]
