"""The client's end of a virtual bus in lock-step, in the process of the bus."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.serial_port import PortLostError, SerialPort
from drivers.virtual_bus.serving.server import VirtualBus

POLL = 0.002  # s between two looks whether the bus is done
LONGEST = 5.0  # s for which a bus may handle what was written, or bytes may be on their way


class LockStepPort(SerialPort):
    """A serial port on which a reply is missing once the bus has done all that was written.

    No time of the wall ends a read, so that neither a busy computer loses a reply, nor is anything
    waited for that does not come.
    """

    def __init__(self, path: str, baud: int, bus: VirtualBus) -> None:
        super().__init__(path, baud)
        self._bus = bus
        self._written = self._received = 0

    def open(self) -> None:
        """Open and lock the device; harmless if it is open."""
        if self.is_open:
            return
        super().open()
        self._written, self._received = self._bus.handled, self._bus.delivered

    def close(self) -> None:
        """Unlock and close the device, once the bus has handled what was written."""
        until = time.monotonic() + LONGEST
        while self.is_open and not self._is_handled() and time.monotonic() < until:
            time.sleep(POLL)
        super().close()

    def write(self, data: bytes) -> None:
        """Pass bytes to the bus."""
        self._written += len(data)
        with self._forgetting_what_is_lost():
            super().write(data)

    def read(self, deadline: float) -> bytes:
        """Return received bytes; wait for one until the bus is done, whatever the deadline."""
        del deadline
        until = time.monotonic() + LONGEST
        while True:
            is_done = self._is_done()
            with self._forgetting_what_is_lost():
                data = super().read(0.0 if is_done else time.monotonic() + POLL)
            self._received += len(data)
            if data or is_done or time.monotonic() > until:
                return data

    def flush(self) -> int:
        """Drop received bytes; return their number."""
        with self._forgetting_what_is_lost():
            count = super().flush()
        self._received += count
        return count

    @contextmanager
    def _forgetting_what_is_lost(self) -> Iterator[None]:
        """Expect no more of the bus once its port was unplugged."""
        try:
            yield
        except PortLostError:
            self._written = self._bus.handled
            raise

    def _is_done(self) -> bool:
        """Return whether the bus has handled all bytes, and all of its own have come; or ended."""
        has_all = self._received >= self._bus.delivered or not self._bus.running
        return self._is_handled() and has_all

    def _is_handled(self) -> bool:
        """Return whether the bus has handled all bytes that were written, or has ended."""
        return self._bus.handled >= self._written or not self._bus.running
