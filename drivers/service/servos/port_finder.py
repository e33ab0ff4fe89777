"""Finds the port of an adapter by unplugging it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from drivers.errors import SetupError
from drivers.service.scan import list_serial_ports


class PortFinder:
    """Compares the ports before and after an adapter is unplugged."""

    def __init__(self, others: Iterable[Path] = ()) -> None:
        """Note the ports that are there, and some more paths, such as those of a virtual bus.

        Raises:
            SetupError: if there is none.
        """
        self._others = tuple(others)
        self.before = self._list()
        """Paths of the ports that were there."""
        if not self.before:
            raise SetupError("no serial port is there: plug the adapter in first (lsusb, dmesg)")

    def find(self) -> str:
        """Find the port that is gone since.

        Raises:
            SetupError: if none or several are.
        """
        gone = sorted(self.before - self._list())
        if len(gone) == 1:
            return gone[0]
        listed = ", ".join(gone) or "none"
        raise SetupError(f"ports that are gone since: {listed}, expected one: unplug one adapter")

    def _list(self) -> set[str]:
        others = {str(path) for path in self._others if path.exists()}
        return {port.path for port in list_serial_ports()} | others
