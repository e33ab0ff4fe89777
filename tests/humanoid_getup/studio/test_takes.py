"""Takes of a rise and of a flight."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs the studio extra")

from dataclasses import replace
from pathlib import Path

from paths import TINY

from humanoid_getup.commands.get_up.play import PlayRequest, play_motion
from humanoid_getup.commands.look.replay import ReplayedFlight, ReplayRequest, replay_flight
from humanoid_getup.reporting.measured_flight import Cut, CutKind
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.tabs.flight_tab import MOST_CUTS, make_take
from humanoid_getup.studio.takes import make_rise_take
from robots import Robot, load_robot

LEAST = 0.02  # s, that are seen
SHIFTED = 1.0  # s


def test_the_ghost_of_a_plan_keeps_time_with_the_robot():
    world = World(load_robot("op3"))
    finished = play_motion(PlayRequest(motion="prone_push_up_gentle", origin="prone", seed=1))
    take = make_rise_take(world, finished.rise, "rise")
    assert take is not None
    assert take.ghost is not None
    joints = world.robot.layout(world.model).qpos
    measured, planned = take.qpos[:, joints], take.ghost[:, joints]
    period = take.time[1] - take.time[0]
    most = round(SHIFTED / period)
    rows = np.arange(most, len(take.time) - most)
    shifts = range(-most, most + 1)
    apart = [float(np.abs(measured[rows] - planned[rows - shift]).mean()) for shift in shifts]
    assert abs(shifts[int(np.argmin(apart))] * period) <= LEAST


@pytest.fixture(scope="module")
def flight(swing: Path) -> ReplayedFlight:
    return replay_flight(ReplayRequest(log=swing, robot=str(TINY)))


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
