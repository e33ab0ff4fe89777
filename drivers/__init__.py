"""Hardware abstraction: backends, twin, safety guard and control loop."""

from drivers.backend import Backend, Release
from drivers.control_loop import (
    Controller,
    Cycle,
    Ending,
    Guidance,
    RunReport,
    engaged,
    run,
    run_engaged,
)
from drivers.errors import DriverError
from drivers.safety_guard import Fault, FaultKind, SafetyGuard
from drivers.safety_limits import ClipCounts, GuardLimits
from drivers.state import Command, State
from drivers.twin.backend import Twin

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
    "Guidance",
    "Release",
    "RunReport",
    "SafetyGuard",
    "State",
    "Twin",
    "engaged",
    "run",
    "run_engaged",
]
