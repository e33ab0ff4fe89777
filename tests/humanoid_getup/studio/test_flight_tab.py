"""The take of a flight, and the lines beside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mjviser")

from paths import TINY

from humanoid_getup.commands.look.replay import ReplayedFlight, ReplayRequest, replay_flight
from humanoid_getup.reporting.measured_flight import Cut, CutKind
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.tabs.flight_tab import MOST_CUTS, make_take
from robots import Robot


@pytest.fixture(scope="module")
def flight(swing: Path) -> ReplayedFlight:
    return replay_flight(ReplayRequest(log=swing, robot=str(TINY)))


def test_the_robot_is_the_measured_one_and_its_ghost_the_twin(flight: ReplayedFlight, tiny: Robot):
    take = make_take(flight, World(tiny))
    np.testing.assert_array_equal(take.qpos, flight.measured.qpos)
    np.testing.assert_array_equal(take.ghost, flight.twin.qpos)
    np.testing.assert_array_equal(take.plots[1].curves["twin"], np.degrees(flight.twin.tilt))
    assert all(len(plot.curves) == tiny.n for plot in take.plots), "of a robot with two joints"


def test_a_flight_in_another_scene_says_so(flight: ReplayedFlight, tiny: Robot):
    assert not [fact for fact in make_take(flight, World(tiny)).facts if "scene" in fact]
    (fact,) = [fact for fact in make_take(flight, World(tiny, "ice")).facts if "scene" in fact]
    assert fact.startswith("recorded in the scene 'flat', shown in 'ice'")


def test_of_many_cuts_the_longest_are_marked(flight: ReplayedFlight, tiny: Robot):
    cuts = tuple(
        Cut(kind=CutKind.TARGET, joints=("l_hip",), begin=k, end=k + k / 100.0, largest=0.1)
        for k in range(MOST_CUTS + 5)
    )
    take = make_take(replace(flight, cuts=cuts), World(tiny))
    assert {mark.time for mark in take.marks if "target" in mark.text} == set(range(5, 25))
    assert "without marks: 0 events, 5 cut commands" in take.facts
