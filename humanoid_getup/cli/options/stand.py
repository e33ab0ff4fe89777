"""Options of `getup sit` and `getup hold`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from humanoid_getup.cli.options.shared import MoveOptions
from humanoid_getup.jobs.requests.shared import BodyOption


@dataclass(frozen=True, kw_only=True)
class Sit(BodyOption, MoveOptions):
    """Sit and lie down from a stand, then torque off.

    A simulated robot starts standing; a real one is held by a person until it moves.
    """

    then: ClassVar[Literal["sit"]] = "sit"
    ending: ClassVar[Literal["sit"]] = "sit"


@dataclass(frozen=True, kw_only=True)
class Hold(BodyOption, MoveOptions):
    """Hold a robot in its stand, supervised, until a key is pressed.

    A simulated robot starts standing; a real one is held by a person until it has torque. In
    simulated time or without a terminal, the stand is held just long enough to be judged.
    """

    then: Literal["sit", "limp", "hand-over"] = "sit"
    """After that: sit and lie down, torque off where it stands, or leave torque on for another
    program."""

    @property
    def ending(self) -> Literal["hold", "limp", "hand-over"]:
        """What the robot does: it is always held first."""
        return "hold" if self.then == "sit" else self.then
