"""Messages between the process of the wire and that of the physics, which starts it."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.virtual_bus.devices.quirks import Quirks
from drivers.virtual_bus.serving.interfaces import WireStatistics
from drivers.virtual_bus.serving.server import PortOptions
from robots import Robot

Statistics = dict[str, WireStatistics]
"""Counts of each port by its name: the reply to `Count`."""


@dataclass(frozen=True, kw_only=True)
class WireSetup:
    """What the process serves."""

    robot: Robot
    options: PortOptions
    powered: bool
    quirks: Quirks | None


@dataclass(frozen=True, kw_only=True)
class PhysicsRequest:
    """A method of the physics to call."""

    name: str
    values: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class TorqueOff:
    """A request to switch torque off, as for a robot that is placed."""


@dataclass(frozen=True, kw_only=True)
class Peek:
    """A request for a register of all servos."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Count:
    """A request for the statistics of all wires."""
