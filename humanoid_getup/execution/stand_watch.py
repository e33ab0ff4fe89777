"""The watch over a held robot until its stand is judged."""

from __future__ import annotations

from collections.abc import Callable

from drivers import Cycle
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.playback.play import AnyJudge

LONGEST_WAIT = 3.0 * HOLD  # s that a released robot is still held without a judged stand


class StandWatch:
    """Judges a long stand in pieces until one piece is a held stand.

    A judge keeps every sample, so one that watched for hours would fill the memory and be late.
    """

    def __init__(self, make_judge: Callable[[], AnyJudge], is_released: Callable[[], bool]) -> None:
        self._make_judge, self._is_released = make_judge, is_released
        self._judge = make_judge()
        self._began: float | None = None
        self._released_at: float | None = None
        self._now = 0.0
        self.stood = False
        """Whether a held stand was observed."""

    def __call__(self, cycle: Cycle) -> None:
        """Observe a cycle."""
        self._now = cycle.state.time
        if self.stood:
            return
        self._judge(cycle)
        if self._began is None:
            self._began = self._now
        if self._now - self._began >= HOLD:
            self.stood = bool(self._judge.end())
            if not self.stood:
                self._judge, self._began = self._make_judge(), None

    def may_end(self) -> bool:
        """Return whether the robot is released, and has stood or will not stand."""
        if not self._is_released():
            self._released_at = None
            return False
        if self._released_at is None:
            self._released_at = self._now
        return self.stood or self._now - self._released_at > LONGEST_WAIT

    def end(self) -> None:
        """Stop observing."""
        self._judge.end()
