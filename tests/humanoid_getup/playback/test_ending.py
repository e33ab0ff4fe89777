"""A motion ends as it is meant to: in a held stand, softly on its side, or anywhere."""

from dataclasses import replace

import numpy as np
import pytest
from records import make_record

from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.simulated_play import has_succeeded
from robots import Robot, quaternion

SUPINE = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -np.pi / 2)


@pytest.fixture(scope="module")
def rising(op3: Robot) -> Motion:
    return next(motion for motion in load_database(op3).motions if motion.rises)


def lie(robot: Robot, **changes) -> Outcome:
    """Judge two robots that lie on their backs for 2 s, which no robot upright does."""
    shape = (2, 200)
    qpos = np.tile([*np.zeros(3), *SUPINE, *np.zeros(robot.n)], (*shape, 1))
    lying = {"qpos": qpos, "upright": np.zeros(shape, dtype=bool)}
    return Outcome(make_record(robot, shape, 0.01, **(lying | changes)), robot)


def test_a_rise_ends_in_a_held_stand(op3: Robot, rising: Motion):
    upright = np.ones((2, 400), dtype=bool)
    upright[1, 300] = False
    stood = Outcome(make_record(op3, (2, 400), 0.01, upright=upright), op3)
    assert has_succeeded(rising, stood).tolist() == [True, False]
    assert has_succeeded(replace(rising, end_class="supine"), stood).tolist() == [False, False]
    assert not has_succeeded(rising, lie(op3)).any()


def test_a_way_down_ends_on_its_side_and_on_no_other(op3: Robot, rising: Motion):
    for side in ("supine", "prone", "left"):
        down = replace(rising, end_class=side)
        assert has_succeeded(down, lie(op3)).tolist() == [side == "supine"] * 2


@pytest.mark.parametrize(("speed", "is_soft"), [(0.29, True), (0.31, False)])
def test_a_way_down_is_soft_to_the_head(op3: Robot, rising: Motion, speed: float, is_soft: bool):
    """The head of the second robot touches the ground after half a second."""
    touch = np.zeros((2, 200), dtype=bool)
    touch[1, 50:] = True
    outcome = lie(op3, head_touch=touch, head_speed=np.full((2, 200), speed))
    down = replace(rising, end_class="supine")
    assert has_succeeded(down, outcome).tolist() == [True, is_soft]
