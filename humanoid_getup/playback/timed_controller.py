"""Timed controllers: controllers that end by themselves."""

from __future__ import annotations

from typing import Protocol

from drivers.control_loop import Controller


class TimedController(Controller, Protocol):
    """A controller that ends by itself."""

    @property
    def longest(self) -> float:
        """Return its longest duration [s], without the approach to its start."""
        ...
