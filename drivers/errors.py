"""Errors of drivers and backends."""

from __future__ import annotations


class DriverError(Exception):
    """A backend failed."""


class SetupError(DriverError):
    """A setup is impossible as requested; the user has to change it."""


class NotConnectedError(DriverError):
    """A backend was used before ``connect`` or after ``close``."""

    def __init__(self, backend: str) -> None:
        super().__init__(f"{backend} is not connected: call connect() or use it in a 'with' block")
        self.backend = backend


class CommandError(DriverError):
    """A command cannot be sent to servos."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("command refused: " + "; ".join(faults))
        self.faults = faults


class ModelError(SetupError):
    """A simulation model does not fit the robot or its control period."""
