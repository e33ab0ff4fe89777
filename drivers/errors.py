"""What can go wrong between a command and a motor."""

from __future__ import annotations


class DriverError(Exception):
    """A backend cannot do what it promised."""


class SetupError(DriverError):
    """What was asked for cannot be set up as it was asked for: the user's to mend."""


class NotConnectedError(DriverError):
    """A backend was used before ``connect`` or after ``close``."""

    def __init__(self, backend: str) -> None:
        super().__init__(f"{backend} is not connected: call connect() or use it in a 'with' block")
        self.backend = backend


class CommandError(DriverError):
    """A command holds what no servo can be told."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("command refused: " + "; ".join(faults))
        self.faults = faults


class ModelError(SetupError):
    """A simulation model does not fit the robot or its control period."""
