"""Boundaries of a policy, and what a check finds at them."""

from __future__ import annotations

from enum import StrEnum

import msgspec


class Boundary(StrEnum):
    """A boundary at which two programs that run one policy can differ, in order."""

    OBSERVATION = "A: signals to observation"
    ACTION = "B: observation to action"
    TORQUE = "C: action to torque"
    PHYSICS = "D: torque to next state"


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """How policy and trace compare at a boundary."""

    boundary: Boundary
    agrees: bool | None
    """None if it was not compared."""
    difference: float | None = None
    """Largest difference, in the boundary's own unit."""
    unit: str = ""
    cause: str = ""
    """Likely cause of a difference, or why it was not compared."""

    def describe(self) -> str:
        """Write it in one line."""
        if self.agrees is None:
            return f"{self.boundary}: not compared: {self.cause}"
        amount = "" if self.difference is None else f" ({self.difference:.2g} {self.unit}".rstrip()
        amount = f"{amount})" if amount else ""
        if self.agrees:
            return f"{self.boundary}: agrees{amount}"
        return f"{self.boundary}: differs{amount}: {self.cause}"
