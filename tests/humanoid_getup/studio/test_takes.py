"""Takes of a rise."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs the studio extra")

from humanoid_getup.commands.get_up.play import PlayRequest, play_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.takes import make_rise_take
from robots import load_robot

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
