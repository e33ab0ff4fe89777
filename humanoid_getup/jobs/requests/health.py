"""Request to check the robot of a running program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.jobs.requests.shared import JobRequest
from humanoid_getup.jobs.requests.values import at_least, between

MOST_PROCESSES = 1 << 22


@dataclass(frozen=True, kw_only=True)
class HealthRequest(JobRequest):
    """Check the robot that another program moves: rate, ages, supply, heat, torque limits.

    The program must show it (--live). Nothing is sent to the robot, and no cycle of it waits.
    """

    program: Annotated[int | None, at_least(1, at_most=MOST_PROCESSES), arg(metavar="PID")] = None
    """Number of its process; default: that of the only one."""
    seconds: Annotated[float, between(0.2, 60.0, "s"), arg(metavar="S")] = 1.0
    """Time over which its rate is measured [s]."""
