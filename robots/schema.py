"""What a robot.toml says, and all that can be wrong with it by itself."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

from robots.robot import WATCHDOG, BoardSettings, BusSettings, PortSettings
from robots.servo import servo_models
from robots.validation import is_number, shown


class Fields:
    """Reads a table; a field that is missing or wrong adds a fault and reads as a blank.

    So one pass finds all that is wrong. What was read is used only if there is no fault.
    """

    def __init__(self, table: dict[str, Any], owner: str, faults: list[str]) -> None:
        """Read ``table``, whose faults begin with ``owner`` and are added to ``faults``."""
        self._table, self._owner, self._faults = table, owner, faults

    def text(self, key: str) -> str:
        """Read a text; the blank is ''."""
        value = self._table.get(key)
        if _is_text(value):
            return value
        self._refuse(key, "a text")
        return ""

    def texts(self, key: str) -> tuple[str, ...]:
        """Read a list of different texts, at least one; the blank is ()."""
        value = self._table.get(key)
        if isinstance(value, list) and value and all(map(_is_text, value)):
            if len(set(value)) == len(value):
                return tuple(value)
            self._refuse(key, "each name once")
        else:
            self._refuse(key, "a list of texts, at least one")
        return ()

    def number(self, key: str, upper: float, unit: str) -> float:
        """Read a number above 0, at most ``upper``; the blank is nan."""
        value = self._table.get(key)
        if is_number(value) and 0.0 < value <= upper:
            return float(value)
        self._refuse(key, f"above 0 {unit}, at most {upper:g} {unit}", unit)
        return float("nan")

    def integer(self, key: str, lower: int, upper: int) -> int:
        """Read an integer in [lower, upper]; the blank is -1."""
        value = self._table.get(key)
        if isinstance(value, int) and not isinstance(value, bool) and lower <= value <= upper:
            return value
        self._refuse(key, f"an integer from {lower} to {upper}")
        return -1

    def sign(self, key: str) -> int:
        """Read -1 or 1; the blank is 0."""
        value = self._table.get(key)
        if is_number(value) and value in (-1, 1):
            return int(value)
        self._refuse(key, "-1 or 1")
        return 0

    def choice(self, key: str, allowed: Iterable[str]) -> str:
        """Read one of a few texts; the blank is ''."""
        value, allowed = self._table.get(key), list(allowed)
        if isinstance(value, str) and value in allowed:
            return value
        self._refuse(key, ", ".join(allowed))
        return ""

    def _refuse(self, key: str, allowed: str, unit: str = "") -> None:
        value = self._table.get(key)
        told = f"is {shown(value)} {unit if is_number(value) else ''}".rstrip()
        if key not in self._table:
            told = "is missing"
        self._faults.append(f"{self._owner}{key} {told}, allowed {allowed}")


def _is_text(value: Any) -> TypeGuard[str]:
    return isinstance(value, str) and bool(value.strip()) and value.isprintable()


BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
"""What X-series servos can be set to [bit/s] (e-manual, Baud Rate)."""
MAIN_PORT = "main"  # name of the port when all joints share one
MAX_WATCHDOG = 2.54  # s, 127 steps of 20 ms (e-manual, Bus Watchdog)
MAX_BOARD_ID = 252


def read_bus(table: Any, joints: tuple[str, ...], faults: list[str]) -> BusSettings | None:
    """Read the bus table of a robot.toml; None when there is none."""
    if table is None:
        return None
    if not isinstance(table, dict):
        faults.append(f"bus is {shown(table)}, allowed a table")
        return None
    fields = Fields(table, "bus: ", faults)
    baud = fields.integer("baud", BAUD_RATES[0], BAUD_RATES[-1])
    if baud > 0 and baud not in BAUD_RATES:
        faults.append(f"bus: baud is {baud} bit/s, allowed {', '.join(map(str, BAUD_RATES))}")
    ports = _read_ports(table.get("ports"), joints, faults)
    return BusSettings(
        baud=baud,
        watchdog=fields.number("watchdog", MAX_WATCHDOG, "s") if "watchdog" in table else WATCHDOG,
        ports=ports,
        board=_read_board(table.get("board"), [port.name for port in ports], faults),
    )


def _read_ports(table: Any, joints: tuple[str, ...], faults: list[str]) -> tuple[PortSettings, ...]:
    if table is None:
        return (PortSettings(name=MAIN_PORT, joints=joints),)
    if not isinstance(table, dict) or not table:
        faults.append(f"bus: ports is {shown(table)}, allowed a table of port names and joints")
        return ()
    fields = Fields(table, "bus ports: ", faults)
    ports = tuple(PortSettings(name=name, joints=fields.texts(name)) for name in table)
    told = [joint for port in ports for joint in port.joints]
    faults += [f"bus ports: unknown joint {shown(j)}" for j in told if j not in joints]
    faults += [
        f"bus ports: joint {shown(joint)} is on {told.count(joint)} ports, allowed one"
        for joint in joints
        if told.count(joint) != 1
    ]
    return ports


def _read_board(table: Any, ports: list[str], faults: list[str]) -> BoardSettings | None:
    if table is None:
        return None
    if not isinstance(table, dict):
        faults.append(f"bus: board is {shown(table)}, allowed a table")
        return None
    fields = Fields(table, "bus board: ", faults)
    axes = table.get("imu_axes")
    if not isinstance(axes, list) or len(axes) != 3 or any(axis not in (-1, 1) for axis in axes):
        faults.append(f"bus board: imu_axes is {shown(axes)}, allowed three signs, -1 or 1")
        axes = [1, 1, 1]
    powers = table.get("powers_servos", False)
    if not isinstance(powers, bool):
        faults.append(f"bus board: powers_servos is {shown(powers)}, allowed true or false")
    return BoardSettings(
        model=fields.text("model"),
        id=fields.integer("id", 0, MAX_BOARD_ID),
        imu_axes=(axes[0], axes[1], axes[2]),
        powers_servos=bool(powers),
        port=fields.choice("port", ports) if "port" in table else (ports or [""])[0],
    )


SEGMENTS = ("head", "wrist", "hand", "finger", "thumb", "foot", "toes", "other")

MAX_CONTROL_PERIOD = 1.0  # s; slower than any robot can rise: the period was meant in ms
MAX_SUPPLY_VOLTAGE = 48.0  # V; the servos' own ranges are narrower, and checked as well
MAX_TICKS = 1_048_575  # either way, the servos' extended position range (e-manual)


@dataclass(frozen=True, kw_only=True)
class JointRow:
    """One row of the joints: what the model file cannot say of a joint."""

    name: str
    id: int
    servo: str
    """Name of the servo model."""
    sign: int
    zero_ticks: int
    mirror: str
    """Name of the joint that takes this one's place when left and right are exchanged."""
    mirror_sign: int
    segment: str


@dataclass(frozen=True, kw_only=True)
class Description:
    """A robot.toml; a field that is at fault is blank: '', (), 0, -1 or nan."""

    name: str
    model: str
    torso: str
    neck_site: str
    imu_site: str
    sole_sites: tuple[str, ...]
    control_period: float
    """[s]"""
    supply_voltage: float
    """[V]"""
    joints: tuple[JointRow, ...]
    standing: dict[str, float]
    """Angles by joint name [rad]; the joints not named stand at 0."""
    bus: BusSettings | None
    """None for a robot without a servo bus."""
    rising_joints: tuple[str, ...] = ()
    """One joint of each mirrored pair that a learned rise moves."""
    spreading_joints: tuple[str, ...] = ()
    """One joint of each pair that spreads limbs and comes home by itself."""


def read_description(table: dict[str, Any]) -> tuple[Description, list[str]]:
    """Read the table of a robot.toml; return it and all its faults."""
    faults: list[str] = []
    fields = Fields(table, "", faults)
    description = Description(
        name=fields.text("name"),
        model=fields.text("model"),
        torso=fields.text("torso"),
        neck_site=fields.text("neck_site"),
        imu_site=fields.text("imu_site"),
        sole_sites=fields.texts("sole_sites"),
        control_period=fields.number("control_period", MAX_CONTROL_PERIOD, "s"),
        supply_voltage=fields.number("supply_voltage", MAX_SUPPLY_VOLTAGE, "V"),
        joints=_read_joints(table.get("joints"), faults),
        standing=_read_standing(table.get("standing"), faults),
        bus=None,
    )
    names = tuple(row.name for row in description.joints)
    mirror = {row.name: row.mirror for row in description.joints}
    rising = _read_rising_joints(table, description.joints, mirror, faults)
    description = replace(
        description,
        bus=read_bus(table.get("bus"), names, faults),
        rising_joints=rising,
        spreading_joints=_read_spreading_joints(table, rising, mirror, faults),
    )
    faults += _board_takes_an_id(description)
    faults += _repeated(description.joints)
    faults += _wrong_mirrors(description.joints)
    faults += _wrong_supply(description)
    return description, faults


def _read_joints(rows: Any, faults: list[str]) -> tuple[JointRow, ...]:
    if rows is None:
        faults.append("joints is missing, allowed a list of tables, one a joint")
        return ()
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        faults.append(f"joints is {shown(rows)}, allowed a list of tables, one a joint")
        return ()
    return tuple(_read_joint(row, place, faults) for place, row in enumerate(rows, start=1))


def _read_joint(row: dict[str, Any], place: int, faults: list[str]) -> JointRow:
    name = row.get("name")
    owner = f"joint {shown(name)}" if isinstance(name, str) else f"joint number {place}"
    fields = Fields(row, f"{owner}: ", faults)
    return JointRow(
        name=fields.text("name"),
        id=fields.integer("id", 0, 252),
        servo=fields.choice("servo", servo_models()),
        sign=fields.sign("sign"),
        zero_ticks=fields.integer("zero_ticks", -MAX_TICKS, MAX_TICKS),
        mirror=fields.text("mirror"),
        mirror_sign=fields.sign("mirror_sign"),
        segment=fields.choice("segment", SEGMENTS),
    )


def _read_standing(angles: Any, faults: list[str]) -> dict[str, float]:
    if not isinstance(angles, dict):
        told = "missing" if angles is None else shown(angles)
        faults.append(f"standing is {told}, allowed a table of joint names and angles in rad")
        return {}
    faults += [
        f"standing: joint {shown(name)} is {shown(angle)}, allowed a finite angle in rad"
        for name, angle in angles.items()
        if not is_number(angle)
    ]
    return {name: float(angle) if is_number(angle) else 0.0 for name, angle in angles.items()}


def _read_rising_joints(
    table: dict[str, Any], rows: tuple[JointRow, ...], mirror: dict[str, str], faults: list[str]
) -> tuple[str, ...]:
    """Read which pairs a learned rise moves; those of all limbs where nothing is said."""
    if "rising_joints" not in table:
        limbs = [row.name for row in rows if row.segment != "head"]
        pairs = {frozenset((name, mirror[name])): name for name in reversed(limbs)}
        return tuple(name for pair, name in reversed(pairs.items()) if len(pair) > 1)
    return _read_pairs("rising_joints", table, mirror, faults)


def _read_spreading_joints(
    table: dict[str, Any], rising: tuple[str, ...], mirror: dict[str, str], faults: list[str]
) -> tuple[str, ...]:
    """Read which pairs spread limbs; none where nothing is said."""
    key = "spreading_joints"
    if key not in table:
        return ()
    names = _read_pairs(key, table, mirror, faults)
    faults += [
        f"{key}: {shown(name)} is one of rising_joints, allowed others"
        for name in names
        if name in rising or mirror.get(name) in rising
    ]
    return names


def _read_pairs(
    key: str, table: dict[str, Any], mirror: dict[str, str], faults: list[str]
) -> tuple[str, ...]:
    """Read names of joints, one of a mirrored pair each."""
    names = Fields(table, "", faults).texts(key)
    for name in names:
        if name not in mirror:
            faults.append(f"{key}: unknown joint {shown(name)}")
        elif mirror[name] == name or mirror[name] in names:
            faults.append(f"{key}: {shown(name)}, allowed one joint of a mirrored pair")
    return names


def _repeated(rows: tuple[JointRow, ...]) -> list[str]:
    names = Counter(row.name for row in rows if row.name)
    faults = [
        f"joint {shown(name)} is described {count} times, allowed once"
        for name, count in names.items()
        if count > 1
    ]
    for servo_id, count in Counter(row.id for row in rows if row.id >= 0).items():
        if count > 1:
            joints = ", ".join(shown(row.name) for row in rows if row.id == servo_id)
            faults.append(f"joints {joints} have one servo id, {servo_id}, allowed one id each")
    return faults


def _board_takes_an_id(description: Description) -> list[str]:
    board = description.bus.board if description.bus else None
    return [
        f"bus board: id is {row.id}, that of joint {shown(row.name)}, allowed one of its own"
        for row in description.joints
        if board is not None and row.id == board.id >= 0
    ]


def _wrong_mirrors(rows: tuple[JointRow, ...]) -> list[str]:
    """Find mirrors that do not lead back: mirroring twice must change nothing."""
    by_name = {row.name: row for row in rows}
    faults = []
    for row in rows:
        image, owner = by_name.get(row.mirror), f"joint {shown(row.name)}: "
        if not row.mirror:
            continue
        if image is None:
            faults.append(f"{owner}unknown mirror joint {shown(row.mirror)}")
        elif image.mirror and image.mirror != row.name:
            faults.append(
                f"{owner}its mirror {shown(image.name)} has the mirror {shown(image.mirror)}, "
                f"allowed {shown(row.name)} (mirrors lead both ways)"
            )
        elif row.mirror_sign * image.mirror_sign == -1 and row.name < image.name:
            faults.append(
                f"{owner}mirror_sign is {row.mirror_sign} and that of its mirror "
                f"{shown(image.name)} is {image.mirror_sign}, allowed the same for both"
            )
    return faults


def _wrong_supply(description: Description) -> list[str]:
    used = {row.servo: row.name for row in reversed(description.joints) if row.servo}
    motors = [(name, servo_models()[servo]) for servo, name in used.items()]
    return [
        f"supply_voltage is {description.supply_voltage:g} V, allowed "
        f"{motor.min_voltage:g} to {motor.max_voltage:g} V by the {motor.name} of joint "
        f"{shown(joint)}"
        for joint, motor in motors
        if description.supply_voltage < motor.min_voltage
        or description.supply_voltage > motor.max_voltage
    ]
