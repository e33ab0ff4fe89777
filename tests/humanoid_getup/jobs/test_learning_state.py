"""What a training says of itself: stands that the assistive force holds do not count."""

from dataclasses import replace

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from humanoid_getup.jobs.learning_state import ASSESSED, TrainedPolicy
from sim2real.training.iteration_log import TrainReport

pytestmark = pytest.mark.train

HELPED = TrainReport(
    iteration=0,
    iterations=500,
    steps=10_240,
    seconds=10.0,
    falls=100,
    stood=60,
    reward=0.1,
    lift=0.8,
    alone=10,
    stood_alone=0,
    height_alone=0.4,
)
"""Of 100 falls 60 end standing, all of them with help."""


def report(policy: TrainedPolicy, **fields: float) -> str:
    """Report an iteration; return what it told."""
    return policy.note(replace(HELPED, **fields))


def test_robots_that_stand_by_the_force_alone_are_not_learning():
    policy = TrainedPolicy(leads=True, motions=3)
    report(policy)
    assert policy.share == 0.0
    assert not policy.is_learning
    assert "0% of falls end standing without help, 60% with up to 80% of the weight" in str(policy)


@pytest.mark.parametrize("better", [{"stood_alone": 3}, {"lift": 0.75}])
def test_robots_that_stand_alone_or_with_less_help_are_learning(better: dict[str, float]):
    policy = TrainedPolicy(leads=True, motions=3)
    report(policy)
    assert not policy.is_learning
    for _ in range(20):
        report(policy, **better)
    assert policy.is_learning


def test_after_ten_minutes_it_is_told_once_whether_the_body_is_learning():
    policy = TrainedPolicy(leads=True, motions=3)
    assert report(policy, seconds=ASSESSED - 1.0) == ""
    told = report(policy, seconds=ASSESSED)
    assert told.startswith("after 10 min 0% of falls end standing without help")
    assert "not learned yet; necks end at 40% of the standing height" in told
    assert report(policy, seconds=ASSESSED + 10.0) == ""


def test_a_training_that_is_continued_later_is_not_assessed_again():
    policy = TrainedPolicy(leads=True, motions=3)
    assert report(policy, iteration=200, seconds=2.0 * ASSESSED) == ""


@pytest.mark.parametrize(
    ("motions", "neck", "lacks"),
    [
        (0, 0.4, "`getup motions discover` finds some"),
        (3, 0.4, "`getup robots check` names joints that are too weak"),
        (3, 0.9, "more --iterations may do"),
    ],
)
def test_what_a_body_lacks_that_does_not_learn(motions: int, neck: float, lacks: str):
    policy = TrainedPolicy(leads=True, motions=motions)
    assert lacks in report(policy, seconds=ASSESSED, height_alone=neck)
