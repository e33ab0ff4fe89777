"""Injects faults into a running bus."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

import numpy as np

from drivers.errors import DriverError
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.serving.physics import Physics
from drivers.virtual_bus.serving.wire_faults import LineFault, LineFaults

T = TypeVar("T")


class Faulty(Protocol):
    """Target of injected faults: a bus with its devices, its physics and its port."""

    devices: Chain
    physics: Physics

    def call(self, action: Callable[[], T]) -> T:
        """Run an action between two instructions; return its result."""
        ...

    def plug(self) -> None:
        """Plug in a new port under the same path."""

    def unplug(self) -> None:
        """Unplug the port while clients may use it."""


def _refuse(fault: str, device: int | None, expected: str) -> DriverError:
    where = "" if device is None else f" of id {device}"
    return DriverError(f"fault '{fault}'{where} cannot be injected: expected {expected}")


class FaultInjector:
    """Injects faults, between two instructions; thread-safe."""

    def __init__(self, bus: Faulty, rng: np.random.Generator) -> None:
        """Inject faults into a bus; ``rng`` draws the random ones."""
        self.line = LineFaults(rng, bus.devices.wire)
        self.silent = False
        self._bus = bus
        self._counts: Counter[str] = Counter()

    @property
    def counts(self) -> Counter[str]:
        """Return how often each kind of fault was made; "silenced": requests to a silent bus."""
        return self._bus.call(lambda: +(self._counts + self.line.counts))

    # Bytes on the wire ---------------------------------------------------------------------

    def set_rate(self, fault: LineFault, rate: float) -> None:
        """Apply a wire fault to a share of all replies, requests or bytes, 0 to 1."""
        self._bus.call(lambda: self.line.set_rate(fault, rate))

    def strike_next(self, fault: LineFault, device: int | None = None, count: int = 1) -> None:
        """Apply a wire fault to the next replies (of one device, or of any) or requests."""
        self._bus.call(lambda: self.line.strike_next(fault, device, count))

    def set_times(self, *, late_by: float | None = None, split_pause: float | None = None) -> None:
        """Set how long late replies and the second parts of split ones are held back [s]."""
        if late_by is not None:
            self.line.late_by = late_by
        if split_pause is not None:
            self.line.split_pause = split_pause

    def silence(self, silent: bool = True) -> None:
        """Disconnect the adapter from all devices: no instruction is executed."""
        self._do("silence", lambda: setattr(self, "silent", silent), counts=silent)

    def count_silenced(self) -> None:
        """Count an instruction that was sent to a silent bus."""
        self._counts["silenced"] += 1

    # Devices -------------------------------------------------------------------------------

    def kill(self, device: int) -> None:
        """Disconnect a device: it neither receives nor replies, and carries on as before."""
        self._do("kill", lambda: self._connect("kill", device, False))

    def revive(self, device: int) -> None:
        """Reconnect a device."""
        self._do("revive", lambda: self._connect("revive", device, True))

    def reboot(self, device: int) -> None:
        """Restart a servo: RAM at its defaults, torque off."""
        self._do("reboot", lambda: self._call("reboot", device))

    def trip(self, device: int, error: int) -> None:
        """Set hardware error bits of a servo (`HardwareError`)."""
        self._do("trip", lambda: self._call("trip", device, error))

    def heat(self, device: int, temperature: float) -> None:
        """Set the temperature of a servo [°C]; from there it follows the thermal model."""
        self._do("heat", lambda: self._heat(device, temperature))

    def freeze_imu(self, frozen: bool = True) -> None:
        """Make every IMU repeat its last measurement."""
        self._do("freeze_imu", lambda: self._freeze(frozen), counts=frozen)

    # Supply and port -----------------------------------------------------------------------

    def sag(self, voltage: float) -> None:
        """Set the battery voltage [V]."""
        self._do("sag", lambda: self._bus.physics.sag(voltage))

    def unplug(self) -> None:
        """Unplug the adapter: the port disappears."""
        self._do("unplug", self._bus.unplug)

    def replug(self) -> None:
        """Plug the adapter in: a new port under the same path."""
        self._do("replug", self._bus.plug)

    def _do(self, name: str, action: Callable[[], object], *, counts: bool = True) -> None:
        def act() -> None:
            action()
            self._counts[name] += counts

        self._bus.call(act)

    def _find(self, fault: str, device: int) -> list[Any]:
        devices = self._bus.devices.devices
        found = [d for d in devices if d.id == device]  # all devices of one id
        if not found:
            ids = ", ".join(str(d.id) for d in devices)
            raise _refuse(fault, device, f"one of the ids {ids}")
        return found

    def _connect(self, fault: str, device: int, alive: bool) -> None:
        for found in self._find(fault, device):
            found.alive = alive

    def _call(self, method: str, device: int, *arguments: int) -> None:
        """Call the method of a servo that a fault is named after."""
        for found in self._find(method, device):
            if not hasattr(found, method):
                raise _refuse(method, device, "a servo")
            getattr(found, method)(*arguments)

    def _heat(self, device: int, temperature: float) -> None:
        self._find("heat", device)
        try:
            self._bus.physics.heat(device, temperature)
        except ValueError as error:
            raise _refuse("heat", device, "a servo") from error

    def _freeze(self, frozen: bool) -> None:
        boards: list[Any] = [d for d in self._bus.devices.devices if hasattr(d, "frozen")]
        if not boards:
            raise _refuse("freeze_imu", None, "a bus with an IMU")
        for board in boards:
            board.frozen = frozen
