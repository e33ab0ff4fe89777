"""A stand that lasts is judged piece by piece."""

from types import SimpleNamespace
from typing import Any, cast

from humanoid_getup.execution.stand_watch import LONGEST_WAIT, StandWatch
from humanoid_getup.experiments.judging.standing import HOLD

PERIOD = 0.1


class Verdicts:
    """Makes judges that each give the next verdict, and counts what they were shown."""

    def __init__(self, *verdicts: bool) -> None:
        self._verdicts, self.made, self.seen = list(verdicts), 0, 0

    def __call__(self) -> Any:
        self.made += 1
        verdict = self._verdicts.pop(0) if self._verdicts else False
        return cast("Any", Judge(self, verdict))


class Judge:
    def __init__(self, owner: Verdicts, verdict: bool) -> None:
        self._owner, self._verdict = owner, verdict

    def __call__(self, _cycle: Any) -> None:
        self._owner.seen += 1

    def end(self) -> bool:
        return self._verdict


def watch_for(watch: StandWatch, seconds: float, start: float = 0.0) -> float:
    """Show cycles; return the time of the last one."""
    for k in range(round(seconds / PERIOD)):
        watch(cast("Any", SimpleNamespace(state=SimpleNamespace(time=start + k * PERIOD))))
    return start + seconds


def test_a_stand_is_seen_once_and_then_nothing_is_kept():
    judges = Verdicts(True)
    watch = StandWatch(judges, lambda: True)
    watch_for(watch, HOLD - PERIOD)
    assert not watch.stood
    assert not watch.may_end()
    watch_for(watch, 3600.0, HOLD - PERIOD)
    assert watch.stood
    assert watch.may_end()
    assert (judges.made, judges.seen) == (1, round(HOLD / PERIOD) + 1)


def test_a_robot_that_sways_is_watched_until_it_stands():
    judges = Verdicts(False, False, True)
    watch = StandWatch(judges, lambda: True)
    watch_for(watch, 2.5 * HOLD)
    assert not watch.stood
    watch_for(watch, HOLD, 2.5 * HOLD)
    assert watch.stood
    assert judges.made == 3


def test_a_released_robot_that_never_stands_still_is_not_held_for_ever():
    released = [False]
    watch = StandWatch(Verdicts(), lambda: released[0])
    now = watch_for(watch, 4.0 * LONGEST_WAIT)
    assert not watch.may_end()
    released[0] = True
    assert not watch.may_end()
    now = watch_for(watch, LONGEST_WAIT, now)
    assert not watch.may_end()
    watch_for(watch, 1.0, now)
    assert watch.may_end()
    assert not watch.stood
