"""What virtual IMUs that send by themselves share."""

from __future__ import annotations


class VirtualSender:
    """The serial line of a sensor that sends by itself and ignores what it receives."""

    def __init__(self) -> None:
        self.alive, self.frozen = True, False
        self._pending = b""

    def take(self) -> bytes:
        """Return what was sent since the last call."""
        pending, self._pending = self._pending, b""
        return pending if self.alive else b""

    def hear(self, data: bytes) -> bytes:
        """Ignore what is sent to it."""
        del data
        return b""
