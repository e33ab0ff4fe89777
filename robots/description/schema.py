"""A robot.toml as dataclasses, and checks of its values against each other."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from msgspec import Meta

from robots.bus_settings import MAIN_PORT, BoardSettings, BusSettings
from robots.imu import IMU_PORT, ImuSettings, find_axes_problems, find_imu_problems
from robots.servo import MAX_TICKS, PGain, ServoModel
from robots.storage.validation import (
    Angle,
    Names,
    Sign,
    between,
    positive,
    read_table,
    shown,
    whole,
)

BOARD_REGISTERS = ("gyro_address", "accelerometer_address", "gyro_scale", "accelerometer_scale")
AXES_BYTES = 6  # of a gyro or an accelerometer: three axes, two bytes each
MIN_CONTROL_PERIOD = 0.001  # s; faster than any servo bus
MAX_CONTROL_PERIOD = 1.0  # s; slower than any robot can rise: the period was meant in ms
MAX_TURNS = 100.0  # of a servo per turn of a joint
LEAST_SINE = 0.02  # of the angle between the rows of a coupling; less, and a servo is wasted
MAX_SUPPLY_VOLTAGE = 48.0  # V; the servos' own ranges are narrower, and checked as well

ControlPeriod = Annotated[float, between(MIN_CONTROL_PERIOD, MAX_CONTROL_PERIOD, "s")]
SupplyVoltage = Annotated[float, positive(MAX_SUPPLY_VOLTAGE, "V")]
SupplyResistance = Annotated[float, between(0.0, 2.0, "Ω")]
Segment = Literal["head", "wrist", "hand", "finger", "thumb", "foot", "toes", "other"]


@dataclass(frozen=True, kw_only=True)
class JointRow:
    """One row of the joints: properties of a joint that the model file cannot hold."""

    name: str
    id: Annotated[int, whole(0, 252)]
    servo: str
    """Name of the servo model."""
    sign: Sign
    zero_ticks: Annotated[int, whole(-MAX_TICKS, MAX_TICKS)]
    mirror: str
    """Name of its counterpart when left and right are exchanged."""
    mirror_sign: Sign
    segment: Segment
    p_gain: PGain | None = None
    """Position P gain; that of the servo type if left out."""
    gear: Annotated[float, between(0.01, 100.0)] = 1.0
    """Turns of the servo per turn of the joint."""


Turns = Annotated[float, between(-MAX_TURNS, MAX_TURNS)]
TurnsRow = Annotated[tuple[Turns, Turns], Meta(description="two numbers")]


@dataclass(frozen=True, kw_only=True)
class CouplingRow:
    """Two joints that two servos turn together."""

    joints: Annotated[tuple[str, str], Meta(description="a list of two joint names")]
    matrix: Annotated[
        tuple[TurnsRow, TurnsRow],
        Meta(description="two rows of two numbers, one row for each servo"),
    ]
    """Turns of each servo (rows) per turn of each joint (columns)."""


@dataclass(frozen=True, kw_only=True)
class RobotTable:
    """The content of a robot.toml."""

    name: str
    model: str
    torso: str
    neck_site: str
    sole_sites: Names
    control_period: ControlPeriod
    supply_voltage: SupplyVoltage
    joints: Annotated[
        tuple[JointRow, ...], Meta(description="a list of tables, one for each joint")
    ]
    standing: Annotated[
        dict[str, Angle], Meta(description="a table of joint names and angles in rad")
    ]
    """Angles by joint name [rad]; the joints not named stand at 0."""
    supply_resistance: SupplyResistance = 0.0
    imu_site: str | None = None
    """None without an IMU."""
    bus: BusSettings | None = None
    imu: ImuSettings | None = None
    rising_joints: Names | None = None
    """One joint of each mirrored pair that a learned rise moves; those of all limbs if left out."""
    spreading_joints: Names = ()
    """One joint of each pair that spreads limbs and comes home by itself."""
    passive_joints: Names = ()
    """Hinges of the model without servo: springs, or coupled to others by equalities."""
    limp_joints: Names = ()
    """Joints whose servos make no torque, such as broken ones; they still measure."""
    couplings: Annotated[
        tuple[CouplingRow, ...], Meta(description="a list of tables, one for each pair of joints")
    ] = ()
    limit_by: Literal["current", "pwm"] | None = None
    """What a torque limit acts on; if left out the current, where all servos sense it."""


def read_description(
    toml: dict[str, Any], servos: Mapping[str, ServoModel]
) -> tuple[RobotTable, list[str]]:
    """Read the table of a robot.toml; return it and all its problems.

    Defaults are filled in; values with problems are blank. ``servos`` are the types that its
    joints may name.
    """
    problems: list[str] = []
    table = read_table(RobotTable, toml, "", problems)
    problems += [
        f"joint {shown(row.name)}: servo is {shown(row.servo)}, expected {', '.join(servos)}"
        for row in table.joints
        if row.servo and row.servo not in servos
    ]
    if table.bus is not None:
        names = tuple(row.name for row in table.joints)
        table = replace(table, bus=complete_bus(table.bus, names, problems))
    mirror = {row.name: row.mirror for row in table.joints}
    rising = _choose_rising_joints(table, mirror, problems)
    problems += _wrong_pairs("spreading_joints", table.spreading_joints, mirror)
    problems += [
        f"spreading_joints: {shown(name)} is one of rising_joints, expected others"
        for name in table.spreading_joints
        if name in rising or mirror.get(name) in rising
    ]
    problems += _board_takes_an_id(table)
    problems += _wrong_imu(table)
    problems += _repeated(table.joints)
    problems += _wrong_mirrors(table.joints)
    problems += _wrong_couplings(table)
    problems += _wrong_limp_joints(table)
    problems += _wrong_supply(table, servos)
    problems += _wrong_limit_mode(table, servos)
    return replace(table, rising_joints=rising), problems


def complete_bus(bus: BusSettings, joints: tuple[str, ...], problems: list[str]) -> BusSettings:
    """Check the ports of a bus and fill in those that a robot.toml may leave out."""
    ports = bus.ports or {MAIN_PORT: joints}
    listed = [joint for names in ports.values() for joint in names]
    if bus.ports:
        problems += [f"bus.ports: unknown joint {shown(j)}" for j in listed if j not in joints]
        problems += [
            f"bus.ports: joint {shown(joint)} is on {listed.count(joint)} ports, expected one"
            for joint in joints
            if listed.count(joint) != 1
        ]
    board = bus.board
    if board is not None:
        if board.port and board.port not in ports:
            problems.append(
                f"bus.board.port is {shown(board.port)}, expected {', '.join(map(shown, ports))}"
            )
        board = replace(board, port=board.port or next(iter(ports)))
    return replace(bus, ports=ports, board=board)


def _choose_rising_joints(
    table: RobotTable, mirror: dict[str, str], problems: list[str]
) -> tuple[str, ...]:
    """Return which pairs a learned rise moves; by default those of all limbs."""
    if table.rising_joints is None:
        limbs = [row.name for row in table.joints if row.segment != "head"]
        pairs = {frozenset((name, mirror[name])): name for name in reversed(limbs)}
        return tuple(name for pair, name in reversed(pairs.items()) if len(pair) > 1)
    problems += _wrong_pairs("rising_joints", table.rising_joints, mirror)
    return table.rising_joints


def _wrong_limp_joints(table: RobotTable) -> list[str]:
    coupled = {name for row in table.couplings for name in row.joints}
    names = {row.name for row in table.joints}
    return [
        f"limp_joints: unknown joint {shown(name)}"
        if name not in names
        else f"limp_joints: {shown(name)} is coupled, expected a joint with a servo of its own"
        for name in table.limp_joints
        if name not in names - coupled
    ]


def _wrong_pairs(key: str, names: tuple[str, ...], mirror: dict[str, str]) -> list[str]:
    """Check that names are joints, one of each mirrored pair."""
    return [
        f"{key}: unknown joint {shown(name)}"
        if name not in mirror
        else f"{key}: {shown(name)}, expected one joint of a mirrored pair"
        for name in names
        if name not in mirror or mirror[name] == name or mirror[name] in names
    ]


def _repeated(rows: tuple[JointRow, ...]) -> list[str]:
    names = Counter(row.name for row in rows if row.name)
    problems = [
        f"joint {shown(name)} is described {count} times, expected once"
        for name, count in names.items()
        if count > 1
    ]
    for servo_id, count in Counter(row.id for row in rows if row.id >= 0).items():
        if count > 1:
            joints = ", ".join(shown(row.name) for row in rows if row.id == servo_id)
            problems.append(f"joints {joints} have one servo id, {servo_id}, expected one id each")
    return problems


def _board_takes_an_id(table: RobotTable) -> list[str]:
    board = table.bus.board if table.bus else None
    return [
        f"bus.board.id is {row.id}, that of joint {shown(row.name)}, expected an id of its own"
        for row in table.joints
        if board is not None and row.id == board.id >= 0
    ]


def _wrong_imu(table: RobotTable) -> list[str]:
    bus, imu = table.bus, table.imu
    board = bus.board if bus else None
    problems = _wrong_board(board) if board else []
    if table.imu_site is None and (imu is not None or board is not None):
        carrier = "imu" if imu is not None else "bus.board"
        problems.append(f"imu_site is missing, expected the site of the IMU of [{carrier}]")
    if imu is None:
        return problems
    if imu.has_own_line and bus is not None and IMU_PORT in bus.ports:
        problems.append(f"bus.ports: {shown(IMU_PORT)} is the port of the IMU, expected another")
    return problems + find_imu_problems(imu, has_board=board is not None)


def _wrong_board(board: BoardSettings) -> list[str]:
    problems = find_axes_problems("bus.board.imu_axes", board.imu_axes)
    if board.model:
        return problems
    missing = [name for name in BOARD_REGISTERS if not getattr(board, name)]
    if missing:
        problems.append(
            f"bus.board.model is missing, expected a model, or {', '.join(BOARD_REGISTERS)} "
            f"(without {', '.join(missing)})"
        )
    elif abs(board.gyro_address - board.accelerometer_address) < AXES_BYTES:
        problems.append(
            f"bus.board.gyro_address is {board.gyro_address} and accelerometer_address "
            f"{board.accelerometer_address}, expected {AXES_BYTES} bytes for each"
        )
    if board.powers_servos:
        problems.append("bus.board.powers_servos is true, expected a model whose switch is known")
    return problems


def _wrong_mirrors(rows: tuple[JointRow, ...]) -> Iterator[str]:
    """Find mirrors that are not mutual: mirroring twice must change nothing."""
    by_name = {row.name: row for row in rows}
    for row in rows:
        image, owner = by_name.get(row.mirror), f"joint {shown(row.name)}: "
        if not row.mirror:
            continue
        if image is None:
            yield f"{owner}unknown mirror joint {shown(row.mirror)}"
        elif image.mirror and image.mirror != row.name:
            yield (
                f"{owner}its mirror {shown(image.name)} has the mirror {shown(image.mirror)}, "
                f"expected {shown(row.name)} (mirrors lead both ways)"
            )
        elif row.mirror_sign * image.mirror_sign == -1 and row.name < image.name:
            yield (
                f"{owner}mirror_sign is {row.mirror_sign} and that of its mirror "
                f"{shown(image.name)} is {image.mirror_sign}, expected the same for both"
            )


def _wrong_couplings(table: RobotTable) -> list[str]:
    rows = {row.name: row for row in table.joints}
    count = Counter(name for coupling in table.couplings for name in coupling.joints)
    problems = [
        f"couplings: unknown joint {shown(name)}" for name in count if name and name not in rows
    ]
    problems += [
        f"couplings: joint {shown(name)} is named {times} times, expected once"
        for name, times in count.items()
        if times > 1
    ]
    problems += [
        f"joint {shown(name)}: gear is {rows[name].gear:g}, expected none: it is in its coupling"
        for name in count
        if name in rows and rows[name].gear != 1.0
    ]
    return problems + [
        f"couplings: matrix of {' and '.join(map(shown, coupling.joints))} is "
        f"{[list(row) for row in coupling.matrix]}, expected {expected}"
        for coupling in table.couplings
        if [len(row) for row in coupling.matrix] == [2, 2]
        if (expected := _expect_matrix(coupling.matrix))
    ]


def _expect_matrix(matrix: tuple[tuple[float, float], tuple[float, float]]) -> str | None:
    """Return what is expected instead of a wrong matrix; None if it is right."""
    (a, b), (c, d) = matrix
    if abs(a * d - b * c) <= LEAST_SINE * math.hypot(a, b) * math.hypot(c, d):
        return "independent rows, so that the servos can turn both joints"
    if a == 0.0 or d == 0.0:
        return "no 0 on the diagonal: exchange the two servos, so that each turns its own joint"
    return None


def _wrong_limit_mode(table: RobotTable, servos: Mapping[str, ServoModel]) -> list[str]:
    if table.limit_by != "current":
        return []
    return [
        f'limit_by is "current", expected "pwm": the {row.servo} of joint {shown(row.name)} has no '
        "current sensor"
        for row in table.joints
        if row.servo in servos and not servos[row.servo].has_current_mode
    ][:1]


def _wrong_supply(table: RobotTable, servos: Mapping[str, ServoModel]) -> list[str]:
    used = {row.servo: row.name for row in reversed(table.joints)}
    motors = [(servos[servo], name) for servo, name in used.items() if servo in servos]
    voltage = table.supply_voltage
    return [
        f"supply_voltage is {voltage:g} V, expected {motor.min_voltage:g} to "
        f"{motor.max_voltage:g} V by the {motor.name} of joint {shown(joint)}"
        for motor, joint in motors
        if not (math.isnan(voltage) or motor.accepts_supply(voltage))
    ]
