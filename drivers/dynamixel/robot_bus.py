"""The bus of a robot whose servos can be driven: each type has a control table."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.dynamixel.control_table import table_named, table_names
from drivers.dynamixel.wire import PROTOCOL_2
from drivers.errors import NoBusError, SetupError
from robots import BusSettings, Robot


class UndrivenServosError(SetupError):
    """A robot has servos whose registers are not known."""

    def __init__(self, robot: str, types: list[str]) -> None:
        super().__init__(
            f"robot '{robot}' has servos {', '.join(types)}, expected those with registers in "
            "drivers/dynamixel/*_tables.toml: it can be simulated alone, by --backend twin"
        )
        self.types = types


def find_bus(robot: Robot) -> BusSettings:
    """Return the bus of a robot.

    Raises:
        NoBusError: if it has none.
        UndrivenServosError: if servos have no control table.
        SetupError: if devices on one port speak different protocols.
    """
    if robot.bus is None:
        raise NoBusError(robot.name)
    types = dict.fromkeys(joint.servo.model.name for joint in robot.joints)
    if undriven := [name for name in types if name not in table_names()]:
        raise UndrivenServosError(robot.name, undriven)
    for port, names in robot.bus.ports.items():
        _check_protocol(robot, port, names)
    return robot.bus


def _check_protocol(robot: Robot, port: str, names: Sequence[str]) -> None:
    """Check that all devices on a port speak one protocol."""
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
