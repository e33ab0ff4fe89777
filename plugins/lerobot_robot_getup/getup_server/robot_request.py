"""The request by which the library opens the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from humanoid_getup.jobs.requests.rise import RiseRequest


@dataclass(frozen=True, kw_only=True)
class RobotRequest(RiseRequest):
    """Robot, backend and way to get up; a simulated robot may begin standing."""

    needs_origin: ClassVar[bool] = False
