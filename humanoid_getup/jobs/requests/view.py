"""Field of requests whose robot can be looked at while the work runs."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.jobs.requests.backend import BackendOptions


@dataclass(frozen=True, kw_only=True)
class ViewOptions(BackendOptions):
    """The robot that a command moves or reads, in a window."""

    view: bool = False
    """Show what the robot measures in MuJoCo's own viewer; a simulated one moves no faster than in
    real time."""
