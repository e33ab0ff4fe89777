"""What a virtual bus is made of, as its wire and its faults see it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from drivers.dynamixel.protocol2 import Damaged, Packet

T = TypeVar("T")


class DeviceReply(Protocol):
    """What one device puts on the wire."""

    @property
    def device(self) -> int:
        """Return the device's id."""
        ...

    @property
    def delay(self) -> float:
        """Return the silence before its first byte [s]."""
        ...

    @property
    def data(self) -> bytes:
        """Return its bytes: a frame, or its part of a fast one."""
        ...


class Device(Protocol):
    """A servo or a board."""

    alive: bool
    """False behind a broken cable: it hears and says nothing."""

    @property
    def id(self) -> int:
        """Return its id."""
        ...

    @property
    def baud(self) -> int:
        """Return the rate at which it talks [bit/s]."""
        ...


class Devices(Protocol):
    """All devices of one bus."""

    @property
    def devices(self) -> Sequence[Device]:
        """Return them, in any order."""
        ...

    def handle(self, item: Packet | Damaged, *, baud: int | None = None) -> Sequence[DeviceReply]:
        """Let them hear an instruction; return their answers in the order of the wire.

        Args:
            item: Instruction, or a frame whose CRC does not match.
            baud: Rate at which it came [bit/s]: devices at another hear nothing of it.
        """
        ...

    def advance(self, now: float) -> None:
        """Let time pass in them, up to a bus time [s]."""
        ...


class Physics(Protocol):
    """The physics behind the devices."""

    @property
    def time(self) -> float:
        """Return the bus time up to which it went [s]."""
        ...

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        ...

    def advance(self, to: float) -> None:
        """Let time pass in physics and devices, up to a bus time [s] or just before it."""
        ...

    def pass_period(self) -> None:
        """Let one control period pass."""
        ...

    def heat(self, servo_id: int, temperature: float) -> None:
        """Bring a servo to a temperature [°C]."""
        ...

    def sag(self, voltage: float) -> None:
        """Set what the battery gives [V]."""
        ...


class StillPhysics:
    """No physics: the devices lie on a table, and only their clocks run."""

    def __init__(self, devices: Devices, period: float = 0.008) -> None:
        """Let devices' clocks run, by a control period [s]."""
        self.time = 0.0
        self.period = period
        self._devices = devices

    def advance(self, to: float) -> None:
        """Let time pass in the devices, up to a bus time [s]."""
        self.time = max(self.time, to)
        self._devices.advance(self.time)

    def pass_period(self) -> None:
        """Let one control period pass."""
        self.advance(self.time + self.period)

    def heat(self, servo_id: int, temperature: float) -> None:
        """Refuse: nothing here has a temperature."""
        raise NotImplementedError("a bus without physics has no temperature to change")

    def sag(self, voltage: float) -> None:
        """Refuse: nothing here has a supply."""
        raise NotImplementedError("a bus without physics has no supply to change")


class Bench(Protocol):
    """A bus that faults can be made on."""

    @property
    def devices(self) -> Devices:
        """Return what hangs on the bus."""
        ...

    @property
    def body(self) -> Physics:
        """Return the physics."""
        ...

    def call(self, action: Callable[[], T]) -> T:
        """Do something between two instructions, and return what it returns."""
        ...

    def plug(self) -> None:
        """Plug the bus' port in."""
        ...

    def unplug(self) -> None:
        """Unplug the bus' port."""
        ...


@dataclass
class WireStatistics:
    """Counts since the bus began; each is a number of its kind, bytes where it says so."""

    bytes_in: int = 0
    """Bytes that clients sent."""
    bytes_out: int = 0
    """Bytes that clients were handed."""
    packets: int = 0
    """Instructions whose CRC matched when they left the client."""
    answers: int = 0
    """Answers that devices gave; each device's part of a fast answer is one."""
    damaged: int = 0
    """Instructions whose CRC did not match when they left the client."""
    noise: int = 0
    """Bytes from clients that belong to no instruction."""
    broken_off: int = 0
    """Instructions dropped for a gap between two of their bytes."""
    wrong_baud: int = 0
    """Instructions that no device heard, for the client's rate is none of theirs."""
    unstuffed: int = 0
    """Instructions that hold FF FF FD and miss the FD after it."""
    talked_over: int = 0
    """Instructions sent while devices still answered the one before."""
    unanswered: int = 0
    """Instructions that ask for an answer and got none."""
    overflow: int = 0
    """Bytes lost because the client did not read."""
    missed: int = 0
    """Bytes lost because the client changed its rate before they arrived."""
    sendings: int = 0
    """Times that bytes were handed over on time's account (real time only)."""
    lateness_total: float = 0.0
    """How much later than the wire would all these were [s]."""
    lateness_max: float = 0.0
    """How much later the latest was [s]."""
