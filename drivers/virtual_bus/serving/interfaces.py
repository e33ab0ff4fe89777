"""Interfaces of devices and physics to the serving of a bus, and its statistics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from drivers.dynamixel.protocol2 import Damaged, Packet
from drivers.dynamixel.wire import Wire
from drivers.virtual_bus.cycle_end import CycleEnd
from drivers.virtual_bus.reply import Reply

T = TypeVar("T")


class Device(Protocol):
    """A servo or a board."""

    alive: bool
    """False behind a broken cable: it neither receives nor replies."""

    @property
    def id(self) -> int:
        """Return its id."""
        ...

    @property
    def baud(self) -> int:
        """Return its baud rate [bit/s]."""
        ...


class Devices(Protocol):
    """All devices of one bus."""

    wire: Wire
    """Protocol that they speak."""
    cycle_end: CycleEnd
    """What ends a control period in lock-step."""

    @property
    def devices(self) -> Sequence[Device]:
        """Return them in any order."""
        ...

    def handle(self, item: Packet | Damaged, *, baud: int | None = None) -> list[Reply]:
        """Execute an instruction sent at a rate [bit/s]; return the replies in their order."""
        ...

    def advance(self, now: float) -> None:
        """Advance the devices to a bus time [s]."""


class Physics(Protocol):
    """The physics behind the devices."""

    time: float
    """Bus time that it has reached [s]."""
    is_light: bool
    """Whether it computes next to nothing, so that its thread may go before all others."""

    def advance(self, to: float) -> None:
        """Advance physics and devices to a bus time [s], or to the last step before it."""

    def pass_period(self) -> None:
        """Advance by one control period."""

    def heat(self, servo_id: int, temperature: float) -> None:
        """Set the temperature of a servo [°C]."""

    def sag(self, voltage: float) -> None:
        """Set the supply voltage [V]."""


class SideLine(Protocol):
    """A further line of a robot, such as its IMU's, served by the thread of a bus."""

    @property
    def path(self) -> str:
        """Return the path at which a client finds it."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 while it is unplugged."""
        ...

    def serve(self) -> None:
        """Handle what clients have sent."""

    def idle(self) -> None:
        """Do what is done while the bus is idle."""

    def close(self) -> None:
        """Remove it."""


class Faulty(Protocol):
    """Target of injected faults: a bus with its devices, its physics and its port."""

    devices: Devices
    physics: Physics

    def call(self, action: Callable[[], T]) -> T:
        """Run an action between two instructions; return its result."""
        ...

    def plug(self) -> None:
        """Plug in a new port under the same path."""

    def unplug(self) -> None:
        """Unplug the port while clients may use it."""


class StillPhysics(Physics):
    """No physics: the devices do not move, and only their clocks advance."""

    is_light = True

    def __init__(self, devices: Devices, period: float = 0.008) -> None:
        """Advance the clocks of devices by control periods [s]."""
        self.time, self.period = 0.0, period
        self._devices = devices

    def advance(self, to: float) -> None:
        """Advance the devices to a bus time [s]."""
        self.time = max(self.time, to)
        self._devices.advance(self.time)

    def pass_period(self) -> None:
        """Advance by one control period."""
        self.advance(self.time + self.period)

    def heat(self, servo_id: int, temperature: float) -> None:
        """Refuse: there is no temperature to set."""
        raise NotImplementedError("a bus without physics has no temperature to change")

    def sag(self, voltage: float) -> None:
        """Refuse: there is no supply to set."""
        raise NotImplementedError("a bus without physics has no supply to change")


@dataclass
class WireStatistics:
    """Counts since the bus was started; of instructions unless stated otherwise."""

    bytes_in: int = 0
    """Bytes sent by clients."""
    bytes_out: int = 0
    """Bytes delivered to clients."""
    packets: int = 0
    """Instructions whose CRC matched when they left the client."""
    answers: int = 0
    """Replies of devices; each device's part of a fast reply is one."""
    damaged: int = 0
    """Instructions whose CRC did not match when they left the client."""
    noise: int = 0
    """Bytes from clients that belong to no instruction."""
    broken_off: int = 0
    """Instructions dropped because of a gap between two of their bytes."""
    wrong_baud: int = 0
    """Instructions sent at a rate that no device is set to."""
    unstuffed: int = 0
    """Instructions that contain FF FF FD without the FD that byte stuffing puts after it."""
    talked_over: int = 0
    """Instructions sent while replies to the one before were still coming."""
    unanswered: int = 0
    """Instructions that expect a reply and got none."""
    overflow: int = 0
    """Bytes lost because the client did not read."""
    missed: int = 0
    """Bytes lost because the client changed its baud rate before they arrived."""
    deliveries: int = 0
    """Batches of bytes delivered in real time."""
    lateness_total: float = 0.0
    """Sum of their delays behind the wire's own timing [s]."""
    lateness_max: float = 0.0
    """Largest of these delays [s]."""
