"""What comes of getting up: the status, every attempt, and why each ended as it did."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from drivers import Ending, RunReport
from humanoid_getup.evaluation.judge import RunOutcome
from humanoid_getup.evaluation.standing import HOLD_TIME
from humanoid_getup.execution.monitors import Abort
from humanoid_getup.execution.preflight import Verdict
from humanoid_getup.strategies.plan import RisePlan


class AttemptStatus(Enum):
    """How getting up ended."""

    STOOD = "the robot stands"
    NEEDS_HELP = "the robot needs help"
    STOPPED = "somebody stopped it"


class Phase(Enum):
    """What an attempt is doing."""

    SETTLING = "waiting until the robot is still"
    PLANNING = "planning"
    PREFLIGHT = "preflight"
    PLAYING = "playing"
    RECOVERING = "recovering"
    ENDED = "ended"


@dataclass(frozen=True)
class PhaseChange:
    """A phase that begins."""

    phase: Phase
    attempt: int
    """From 1."""
    detail: str


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One try to get up, as far as it came."""

    number: int
    """From 1."""
    start_class: str | None = None
    """Side it lay on; None when it did not come to rest."""
    plan: RisePlan | None = None
    verdict: Verdict | None = None
    """Of the preflight."""
    run: RunReport | None = None
    """None when nothing was played."""
    outcome: RunOutcome | None = None
    abort: Abort | None = None
    """Why the supervisor gave up, if it did."""
    warnings: tuple[str, ...] = ()
    refusal: str | None = None
    """Why it was not played."""

    @property
    def stood(self) -> bool:
        """Tell whether it ended in a held stand."""
        if self.run is None or self.outcome is None or self.abort is not None:
            return False
        return self.run.ending is Ending.DONE and self.outcome.stand.stood

    @property
    def reason(self) -> str:
        """Return in one line why it ended as it did."""
        if self.run is None or self.outcome is None:
            return self.refusal or (self.plan.reason if self.plan else "it was not begun")
        if self.stood:
            return "held stand"
        if self.abort is not None:
            return f"gave up after {self.abort.time:.1f} s: {self.abort}"
        if self.run.ending is not Ending.DONE:
            return self.run.reason
        return f"fell: held {self.outcome.stand.hold_time:.1f} s, needed {HOLD_TIME:.1f} s"


@dataclass(frozen=True, kw_only=True)
class AttemptResult:
    """How getting up ended, and every try."""

    status: AttemptStatus
    reason: str
    """One line; for a robot that needs help, what was seen."""
    by_fault: bool = False
    """Whether a fault of the hardware ended it, rather than a rise that failed."""
    attempts: tuple[Attempt, ...]
