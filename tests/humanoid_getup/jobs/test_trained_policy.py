"""What a training says of itself: stands that the assistive force holds do not count."""

from dataclasses import replace

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from humanoid_getup.jobs.train_policy import ASSESSED, TrainedPolicy
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


def begin(motions: int = 3) -> TrainedPolicy:
    return TrainedPolicy(leads=True, motions=motions, lift=HELPED.lift)


def report(policy: TrainedPolicy, **fields: float) -> str:
    """Report an iteration; return what it told."""
    return policy.note(replace(HELPED, **fields))


def test_robots_that_stand_by_the_force_alone_are_not_learning():
    policy = begin()
    report(policy)
    assert policy.share == 0.0
    assert not policy.is_learning
    said = "60% of falls end standing with up to 80% of the weight held, 0% without help"
    assert said in str(policy)


def test_without_a_fall_of_a_kind_no_share_of_it_is_told():
    policy = begin()
    report(policy, falls=0, stood=0, alone=0)
    assert policy.describe() == "no fall has ended yet"
    report(policy, falls=0, stood=0, alone=0, level=2)
    assert policy.describe().endswith("yet; episodes begin on the way, up to level 2")
    assert policy.is_learning
    report(policy, alone=0)
    assert policy.describe().endswith("of the weight held")


def test_a_training_whose_force_has_faded_before_it_was_continued_is_learning():
    policy = begin()
    report(policy, iteration=200, lift=0.3)
    assert policy.is_learning


@pytest.mark.parametrize("better", [{"stood_alone": 3}, {"lift": 0.75}])
def test_robots_that_stand_alone_or_with_less_help_are_learning(better: dict[str, float]):
    policy = begin()
    report(policy)
    assert not policy.is_learning
    for _ in range(20):
        report(policy, **better)
    assert policy.is_learning


def test_after_ten_minutes_it_is_told_once_whether_the_body_is_learning():
    policy = begin()
    assert report(policy, seconds=ASSESSED - 1.0) == ""
    told = report(policy, seconds=ASSESSED)
    assert told.startswith("after 10 min 60% of falls end standing with up to 80%")
    assert "not learned yet; necks end at 40% of the standing height" in told
    assert report(policy, seconds=ASSESSED + 10.0) == ""


def test_a_short_training_blames_nothing():
    policy = begin()
    report(policy, seconds=20.0)
    assert policy.assess().endswith("0% without help: too short to judge")


@pytest.mark.parametrize(
    ("motions", "neck", "lacks"),
    [
        (0, 0.4, "`getup motions discover` finds some"),
        (3, 0.4, "`getup robots check` names joints that are too weak"),
        (3, 0.9, "more --iterations may do"),
    ],
)
def test_what_a_body_lacks_that_does_not_learn(motions: int, neck: float, lacks: str):
    policy = begin(motions)
    assert lacks in report(policy, seconds=ASSESSED, height_alone=neck)
