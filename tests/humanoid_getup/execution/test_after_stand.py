"""The result after a stand is described in one line, with its success."""

from typing import Any

import numpy as np
import pytest

from drivers import ClipCounts, Ending, RunReport
from drivers.control_loop import TimingSummary
from humanoid_getup.execution.after_stand import AfterStand, Step
from humanoid_getup.playback.monitors import Abort, AbortKind

FELL = Abort(AbortKind.FELL, "tilt 40°", 3.26)


def step(ending: Ending = Ending.DONE, duration: float = 3.0, **changes: Any) -> Step:
    run = RunReport(
        ending=ending,
        reason="servo 3 is silent",
        cycles=1,
        overruns=0,
        period=0.008,
        duration=duration,
        clips=ClipCounts(*np.zeros((5, 2))),
        holds=0,
        pace=TimingSummary.of(np.zeros((0, 4))),
    )
    return Step(run=run, **changes)


@pytest.mark.parametrize(
    ("after", "reason"),
    [
        (
            AfterStand(hold=step(duration=0.0), way_down=step()),
            "released at once, sat and lay down, torque off",
        ),
        (AfterStand(way_down=step()), "sat and lay down, torque off"),
        (AfterStand(followed=step()), "followed its pilot for 3.0 s, torque off where it stood"),
    ],
)
def test_what_went_as_it_should_is_reported_in_order(after: AfterStand, reason: str):
    assert after.succeeded
    assert not after.by_fault
    assert after.reason == reason


@pytest.mark.parametrize(
    ("failed", "is_fault", "why"),
    [
        (step(abort=FELL), False, "aborted after 3.3 s: the robot was up and is falling: tilt 40°"),
        (step(Ending.FAULT), True, "servo 3 is silent"),
        (step(succeeded=False), False, "the judge does not accept its end"),
    ],
)
def test_the_first_step_that_failed_is_the_reason(failed: Step, is_fault: bool, why: str):
    assert not failed.is_done
    alone, after_hold = AfterStand(hold=failed), AfterStand(hold=step(), way_down=failed)
    went_on = AfterStand(hold=failed, way_down=step())
    followed = AfterStand(followed=failed)
    for after in (alone, after_hold, went_on, followed):
        assert not after.succeeded
        assert after.by_fault == is_fault
    assert alone.reason == f"holding the stand failed: {why}; torque off"
    assert after_hold.reason == f"sitting and lying down failed: {why}; torque off"
    assert followed.reason == f"following its pilot failed: {why}; torque off"
    assert went_on.reason == f"holding the stand failed: {why}; it sat and lay down"


def test_a_refusal_goes_before_all_else():
    refused = AfterStand(refusal="the robot does not stand")
    assert (refused.succeeded, refused.by_fault) == (False, False)
    assert refused.reason == "the robot does not stand"
    assert AfterStand(refusal="the supply is too low", refused_by_fault=True).by_fault
