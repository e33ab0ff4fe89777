"""A port in memory whose time is a number: what a client sends when, and what it gets when."""

from __future__ import annotations

from collections import deque
from types import SimpleNamespace

import numpy as np
from fake_devices import FakeDevices
from fault_injector import FaultInjector
from still_physics import StillPhysics

from drivers.virtual_bus.serving.exchange import Exchange

LEAST = 1e-7  # s that a wait takes


class FakeWire:
    """The bus's end of a port, and the client's: `send_at` sends, `received` tells."""

    def __init__(self, baud: int = 1_000_000) -> None:
        self.baud, self.plugged, self.room = baud, True, 1 << 20
        self.now = 100.0
        """Wall clock [s]."""
        self.received: list[tuple[float, bytes]] = []
        """Bytes for the client, with their times."""
        self.tidied = 0
        self.is_abandoned = False
        self._coming: deque[tuple[float, bytes]] = deque()
        self._inbox = b""

    @property
    def data(self) -> bytes:
        """Return all bytes for the client."""
        return b"".join(data for _, data in self.received)

    def send_at(self, time: float, data: bytes) -> None:
        """Let bytes of the client arrive at a time of the wall clock [s]."""
        self._coming.append((time, data))

    # As a pseudo-terminal -------------------------------------------------------------------

    def fileno(self) -> int:
        return 3 if self.plugged else -1

    def read(self) -> bytes:
        data, self._inbox = self._inbox, b""
        return data

    def write(self, data: bytes) -> int:
        taken = data[: self.room] if self.plugged else b""
        self.received.append((self.now, taken))
        return len(taken)

    def tidy(self) -> bool:
        self.tidied += 1
        return self.is_abandoned

    # As time --------------------------------------------------------------------------------

    def wait(self, port: int, duration: float) -> bool:
        """Let time pass until the client's next bytes, at most by a duration [s]."""
        until = self.now + max(duration, LEAST)
        if port < 0 or not self._coming or self._coming[0][0] > until:
            self.now = until
            return False
        at, data = self._coming.popleft()
        self.now, self._inbox = max(self.now, at), self._inbox + data
        return True

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        """Pass a microsecond, as a loop that polls takes."""
        self.now += max(duration, 10 * LEAST)


def exchange_with(
    devices: FakeDevices, seed: int = 0, **options: bool
) -> tuple[Exchange, FaultInjector]:
    """Connect devices to an exchange, without a thread; return its faults as well."""
    exchange = Exchange(devices, physics := StillPhysics(devices), **options)
    bus = SimpleNamespace(call=lambda action: action(), devices=devices, physics=physics)
    faults = FaultInjector(bus, np.random.default_rng(seed))
    exchange.line = faults.line
    return exchange, faults
