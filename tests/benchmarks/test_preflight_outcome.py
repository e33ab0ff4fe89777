"""Verdicts of the preflight beside the ends of rises that are played all the same."""

import pytest
from benchmark_scripts import load_script

from humanoid_getup.experiments.starts.falls import sample_fall
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import StoredMotion


@pytest.fixture(scope="module")
def outcome():
    return load_script("preflight_outcome")


def test_each_kind_of_wrong_verdict_is_counted_once(outcome):
    def end(*refusals: str, stood: bool):
        return outcome.Outcome(start_class="prone", planned=True, refusals=refusals, stood=stood)

    deep = "the robot presses 9.0 mm into itself, expected at most 6 mm"
    ends = [
        end(stood=True),
        end(stood=True),
        end(stood=False),
        end(deep, stood=True),
        end(deep, "it does not end in a held stand", stood=False),
        outcome.Outcome(start_class="left", planned=False),
    ]
    counts = outcome.summarize(ends)
    assert (counts["n"], counts["planned"]) == (6, 5)
    assert (counts["refused"], counts["stood"]) == (2, 3)
    assert counts["refused_though_it_stands"] == 1
    assert counts["passed_though_it_falls"] == 1
    assert counts["refusals_of_those_that_stood"] == {"into itself": 1}


def test_nothing_planned_is_nothing_judged(outcome):
    counts = outcome.summarize([outcome.Outcome(start_class="left", planned=False)])
    assert (counts["planned"], counts["refused"], counts["stood"]) == (0, 0, 0)


def test_a_refused_rise_is_played_all_the_same(outcome, world: World):
    fall = sample_fall(world, "prone", seed=1)
    end = outcome.rise(world, StoredMotion(world, "supine_sit_up_fast"), fall, [0, 0])
    assert end.planned and end.refused and not end.stood
    assert any("the motion begins supine" in text for text in end.refusals)
