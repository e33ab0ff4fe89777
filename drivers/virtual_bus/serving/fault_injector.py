"""Faults on demand: what can break on a bus of servos, while it is running."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from drivers.errors import DriverError
from drivers.virtual_bus.serving.interfaces import Bench
from drivers.virtual_bus.serving.wire_faults import LineFault, LineFaults


class FaultError(DriverError):
    """A fault was asked for that cannot happen on this bus."""

    def __init__(self, fault: str, device: int | None, allowed: str) -> None:
        where = "" if device is None else f" of id {device}"
        super().__init__(f"fault '{fault}'{where} cannot happen here, allowed {allowed}")
        self.fault, self.device = fault, device


class Faults:
    """Breaks things; may be asked to by any thread.

    What it does to devices happens between two instructions.
    """

    def __init__(self, bench: Bench, rng: np.random.Generator) -> None:
        """Make faults on a bus, from a random source where chance has a part."""
        self.line = LineFaults(rng)
        self.silent = False
        self._bench = bench
        self._counts: Counter[str] = Counter()

    @property
    def counts(self) -> Counter[str]:
        """Return how often each kind of fault was made; "silenced": requests to a silent bus."""
        return self._bench.call(lambda: +(self._counts + self.line.counts))

    # Bytes on the wire ---------------------------------------------------------------------

    def set_rate(self, fault: LineFault, rate: float) -> None:
        """Let a mishap take a share of all answers, requests or bytes, 0 to 1."""
        self._bench.call(lambda: self.line.set_rate(fault, rate))

    def order(self, fault: LineFault, device: int | None = None, count: int = 1) -> None:
        """Let a mishap take the next answers of a device, or of any; or the next requests."""
        self._bench.call(lambda: self.line.order(fault, device, count))

    def set_times(self, *, late_by: float | None = None, split_pause: float | None = None) -> None:
        """Set how long late answers and second parts are kept back [s]."""
        if late_by is not None:
            self.line.late_by = late_by
        if split_pause is not None:
            self.line.split_pause = split_pause

    def silence(self, silent: bool = True) -> None:
        """Cut the wire between adapter and devices: nothing is heard or answered."""
        self._do("silence", lambda: setattr(self, "silent", silent), counts=silent)

    def note_silenced(self) -> None:
        """Count a request that met a silent bus."""
        self._counts["silenced"] += 1

    # Devices -------------------------------------------------------------------------------

    def kill(self, device: int) -> None:
        """Break a device's cable: it hears and says nothing, and goes on doing what it does."""
        self._do("kill", lambda: self._set("kill", device, "alive", False))

    def revive(self, device: int) -> None:
        """Mend a device's cable."""
        self._do("revive", lambda: self._set("revive", device, "alive", True))

    def reboot(self, device: int) -> None:
        """Restart a servo: its RAM goes back to defaults, torque off."""
        self._do("reboot", lambda: self._ask("reboot", device, "reboot"))

    def trip(self, device: int, error: int) -> None:
        """Raise hardware error bits of a servo (`HardwareError`)."""
        self._do("trip", lambda: self._ask("trip", device, "trip", error))

    def heat(self, device: int, temperature: float) -> None:
        """Bring a servo to a temperature [°C]; it cools as physics lets it."""
        self._do("heat", lambda: self._heat(device, temperature))

    def freeze_imu(self, frozen: bool = True) -> None:
        """Let every IMU repeat its last measurement."""
        self._do("freeze_imu", lambda: self._freeze(frozen), counts=frozen)

    # Supply and port -----------------------------------------------------------------------

    def sag(self, voltage: float) -> None:
        """Let the battery give another voltage from now on [V]."""
        self._do("sag", lambda: self._bench.body.sag(voltage))

    def unplug(self) -> None:
        """Pull the adapter out: the port is gone."""
        self._do("unplug", self._bench.unplug)

    def replug(self) -> None:
        """Plug the adapter in: a new port, under the old path."""
        self._do("replug", self._bench.plug)

    def _do(self, name: str, action: Callable[[], object], *, counts: bool = True) -> None:
        def act() -> None:
            action()
            self._counts[name] += counts

        self._bench.call(act)

    def _find(self, fault: str, device: int) -> list[Any]:
        devices = self._bench.devices.devices
        found = [d for d in devices if d.id == device]  # two with one id break together
        if not found:
            ids = ", ".join(str(d.id) for d in devices)
            raise FaultError(fault, device, f"ids {ids}")
        return found

    def _set(self, fault: str, device: int, name: str, value: object) -> None:
        for found in self._find(fault, device):
            setattr(found, name, value)

    def _ask(self, fault: str, device: int, method: str, *arguments: object) -> None:
        for found in self._find(fault, device):
            if not hasattr(found, method):
                raise FaultError(fault, device, "servos")
            getattr(found, method)(*arguments)

    def _heat(self, device: int, temperature: float) -> None:
        self._find("heat", device)
        try:
            self._bench.body.heat(device, temperature)
        except ValueError as error:
            raise FaultError("heat", device, "servos") from error

    def _freeze(self, frozen: bool) -> None:
        boards: list[Any] = [d for d in self._bench.devices.devices if hasattr(d, "frozen")]
        if not boards:
            raise FaultError("freeze_imu", None, "a bus with an IMU")
        for board in boards:
            board.frozen = frozen
