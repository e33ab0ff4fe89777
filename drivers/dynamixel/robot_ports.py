"""The ports of a robot: each has a bus with some of its servos, one also its board."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from drivers.dynamixel.board import Board
from drivers.dynamixel.bus import FACTORY_RETURN_DELAY, DynamixelBus
from drivers.dynamixel.control_table import table_named, table_names
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.errors import SetupError
from drivers.imu.build import build_imu_source
from drivers.imu.source import ImuSource
from drivers.serial_port import MakePort, PortRefusedError, SerialPort
from robots import BusSettings, Joint, Robot
from robots.imu import IMU_PORT


@dataclass(frozen=True)
class RobotPort:
    """One port of a robot, and the devices on its bus."""

    name: str
    """The port's name in the robot's description."""
    bus: DynamixelBus
    joints: tuple[Joint, ...]
    """Joints of its servos, in the robot's joint order."""
    board: Board | None
    """The controller board, if it is on this port."""


def build_ports(
    robot: Robot,
    paths: Mapping[str, str],
    make_port: MakePort,
    *,
    answer_margin: float,
    sleeps: bool = True,
) -> list[RobotPort]:
    """Build the ports of a robot with a bus; nothing is opened yet.

    ``paths`` names the device of each port, by its name in the robot's description; the other
    parameters are those of `DynamixelBus`.
    """
    settings, ports = find_bus(robot), list[RobotPort]()
    for name, joints in settings.ports.items():
        here = tuple(joint for joint in robot.actuators if joint.name in joints)
        tables = [table_named(joint.servo.model.name) for joint in here]
        bus = DynamixelBus(
            make_port(paths[name], settings.baud),
            answer_margin=answer_margin,
            sleeps=sleeps,
            wire=tables[0].wire,
            instructions=frozenset.intersection(*(table.instructions for table in tables)),
        )
        board = None
        if settings.board and settings.board.port == name:
            board = Board(bus, settings.board, carries_imu=robot.imu_kind == "board")
        ports.append(RobotPort(name, bus, here, board))
    return ports


def find_imu(
    robot: Robot, ports: Iterable[RobotPort], paths: Mapping[str, str]
) -> ImuSource | None:
    """Return the source of the IMU's samples: the board, or what is on a line of its own.

    None for a robot without an IMU.
    """
    if robot.imu_kind == "board":
        return next(port.board for port in ports if port.board)
    return robot.imu and build_imu_source(robot.imu, paths.get(IMU_PORT, ""), SerialPort)


def open_ports(buses: Sequence[DynamixelBus]) -> None:
    """Open the ports of some buses; raise one `SetupError` for those that do not open."""
    errors: list[PortRefusedError] = []
    for bus in buses:
        bus.return_delay = FACTORY_RETURN_DELAY
        try:
            bus.port.open()
        except PortRefusedError as error:
            errors.append(error)
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise SetupError("; ".join(map(str, errors)))


@contextmanager
def using_margin(buses: Iterable[DynamixelBus], margin: float) -> Iterator[None]:
    """Use another answer margin [s] on some buses inside the block."""
    before = [(bus, bus.answer_margin) for bus in buses]
    for bus, _ in before:
        bus.answer_margin = margin
    try:
        yield
    finally:
        for bus, own in before:
            bus.answer_margin = own


def find_bus(robot: Robot) -> BusSettings:
    """Return the bus of a robot; raise `SetupError` if its servos cannot be driven on it."""
    if robot.bus is None:
        raise SetupError(
            f"robot '{robot.name}' has no servo bus: add a [bus] table to its robot.toml"
        )
    types = dict.fromkeys(joint.servo.model.name for joint in robot.joints)
    if undriven := [name for name in types if name not in table_names()]:
        raise SetupError(
            f"robot '{robot.name}' has servos {', '.join(undriven)}, expected those with registers "
            "in drivers/dynamixel/*_tables.toml: it can be simulated alone, by --backend twin"
        )
    for port, names in robot.bus.ports.items():
        _check_protocol(robot, port, names)
    return robot.bus


def _check_protocol(robot: Robot, port: str, names: Sequence[str]) -> None:
    models = {j.servo.model.name for j in robot.joints if j.name in names}
    wires = {table_named(model).wire.name for model in models}
    if len(wires) > 1:
        raise SetupError(
            f"servos {', '.join(sorted(models))} speak different protocols "
            f"({', '.join(sorted(wires))}): give each a port"
        )
    board = robot.bus and robot.bus.board
    if board and board.port == port and wires != {PROTOCOL_2.name}:
        raise SetupError(
            f"the board on port '{port}' speaks Protocol 2.0 and its servos "
            f"{', '.join(sorted(models))} do not: give the servos a port of their own"
        )
