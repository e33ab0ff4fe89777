"""Take: a recorded or planned motion that the timeline plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Mark:
    """An event on the timeline."""

    time: float
    """[s]"""
    text: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Plot:
    """Curves over the time of a take."""

    title: str
    curves: dict[str, Array]
    """Values by name, (T,) each, NaN where unknown."""
    limit: float | None = None
    """Value at which a line is drawn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Take:
    """A motion of the robot, and of its ghost, that can be scrubbed."""

    name: str
    time: Array
    """Times from the start [s], (T,)."""
    qpos: Array
    """MuJoCo positions of the robot in its world, (T, nq)."""
    ghost: Array | None = None
    """The same of the ghost: a reference, a target or a twin."""
    joint_torque: Array | None = None
    """Torques at the joints [N·m], (T, n), by which contact forces are computed."""
    plots: tuple[Plot, ...] = ()
    marks: tuple[Mark, ...] = ()
    facts: tuple[str, ...] = ()
    """Lines of plain text about its result, first the headline."""

    def __post_init__(self) -> None:
        if not len(self.time) or np.any(np.diff(self.time) < 0.0):
            raise ValueError("time is empty or not increasing, expected rising times")
        for name in ("qpos", "ghost", "joint_torque"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.time):
                raise ValueError(f"{name} has {len(values)} rows for {len(self.time)} times")

    @property
    def duration(self) -> float:
        """Return the time from the first sample to the last one [s]."""
        return float(self.time[-1] - self.time[0])

    def find(self, time: float) -> int:
        """Find the last sample at or before a time from the first one [s]."""
        last = int(np.searchsorted(self.time, self.time[0] + time + 1e-9, side="right")) - 1
        return min(max(last, 0), len(self.time) - 1)
