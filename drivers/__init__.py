"""Hardware abstraction: backends, twin, safety guard and control loop."""

from drivers.backend import Backend
from drivers.control import Controller, Cycle, Ending, RunReport, run
from drivers.errors import DriverError
from drivers.guard import Fault, FaultKind, SafetyGuard
from drivers.guard_limits import ClipCounts, GuardLimits
from drivers.state import Command, State
from drivers.twin import Twin

__all__ = [
    "Backend",
    "ClipCounts",
    "Command",
    "Controller",
    "Cycle",
    "DriverError",
    "Ending",
    "Fault",
    "FaultKind",
    "GuardLimits",
    "RunReport",
    "SafetyGuard",
    "State",
    "Twin",
    "run",
]
