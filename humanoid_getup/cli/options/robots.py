"""Options of `robots list`, `import` and `check`."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.cli.options.shared import JsonOption, PictureOption
from humanoid_getup.jobs.requests.robots import CheckRequest


@dataclass(frozen=True, kw_only=True)
class ListRobots(JsonOption):
    """List the robots that come with the program."""


@dataclass(frozen=True, kw_only=True)
class CheckRobot(PictureOption, JsonOption, CheckRequest):
    """Check whether a robot's description is sound and its body able to get up; one finding a
    line, each with what to do. The picture is of the stance and of the deepest squat."""
