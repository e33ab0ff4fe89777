"""The client's end of a virtual bus in lock-step, in the process of the bus."""

from __future__ import annotations

import time
from typing import Protocol

from drivers.serial_port import SerialPort

POLL = 0.002  # s between two looks whether the bus is done
LONGEST = 5.0  # s for which a bus may handle what was written, or bytes may be on their way


class CountingBus(Protocol):
    """A bus that counts the bytes of its port."""

    @property
    def running(self) -> bool:
        """Return whether it serves its port."""
        ...

    @property
    def handled(self) -> int:
        """Return the bytes of clients that it has read, and done what they say."""
        ...

    @property
    def delivered(self) -> int:
        """Return the bytes that it has written to its port."""
        ...


class LockStepPort(SerialPort):
    """A serial port on which a reply is missing once the bus has done all that was written.

    No time of the wall ends a read, so that neither a busy computer loses a reply, nor is anything
    waited for that does not come.
    """

    def __init__(self, path: str, baud: int, bus: CountingBus) -> None:
        super().__init__(path, baud)
        self._bus = bus
        self._written = self._received = 0

    def open(self) -> None:
        """Open and lock the device; harmless if it is open."""
        if self.is_open:
            return
        super().open()
        self._written, self._received = self._bus.handled, self._bus.delivered

    def write(self, data: bytes) -> None:
        """Pass bytes to the bus."""
        self._written += len(data)
        super().write(data)

    def read(self, deadline: float) -> bytes:
        """Return received bytes; wait for one until the bus is done, whatever the deadline."""
        del deadline
        until = time.monotonic() + LONGEST
        while True:
            is_done = self._is_done()
            data = super().read(0.0 if is_done else time.monotonic() + POLL)
            self._received += len(data)
            if data or is_done or time.monotonic() > until:
                return data

    def flush(self) -> int:
        """Drop received bytes; return their number."""
        count = super().flush()
        self._received += count
        return count

    def _is_done(self) -> bool:
        """Return whether the bus has handled all bytes, and all of its own have come; or ended."""
        if not self._bus.running:
            return True
        return self._bus.handled >= self._written and self._received >= self._bus.delivered
