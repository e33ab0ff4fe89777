"""The bus of a robot whose servos can be driven: each type has a control table."""

from __future__ import annotations

from drivers.dynamixel.control_table import known_models
from drivers.errors import NoBusError, SetupError
from robots import BusSettings, Robot


class UndrivenServosError(SetupError):
    """A robot has servos whose registers are not known, such as those of another protocol."""

    def __init__(self, robot: str, types: list[str]) -> None:
        super().__init__(
            f"robot '{robot}' has servos {', '.join(types)}, expected Dynamixels of Protocol 2.0 "
            "with registers in drivers/dynamixel/control_tables.toml: it can be simulated alone, "
            "by --backend twin"
        )
        self.types = types


def find_bus(robot: Robot) -> BusSettings:
    """Return the bus of a robot.

    Raises:
        NoBusError: if it has none.
        UndrivenServosError: if servos have no control table.
    """
    if robot.bus is None:
        raise NoBusError(robot.name)
    types = dict.fromkeys(joint.servo.model.name for joint in robot.joints)
    if undriven := [name for name in types if name not in known_models()]:
        raise UndrivenServosError(robot.name, undriven)
    return robot.bus
