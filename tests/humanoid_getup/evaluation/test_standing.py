import numpy as np
import pytest

from humanoid_getup.evaluation.standing import HOLD_TIME, is_upright, judge
from robots import load_robot

PERIOD = 0.01


@pytest.fixture(scope="module")
def robot():
    return load_robot("op3")


def test_a_stand_counts_from_its_first_unbroken_moment():
    upright = np.array([False] * 120 + [True] * 301)
    stand = judge(upright, PERIOD)
    assert stand.stood
    assert stand.start_time == pytest.approx(1.21)  # sample 120 ends the 121st period
    assert stand.hold_time == pytest.approx(3.0)  # 301 samples span 300 periods


def test_a_stand_shorter_than_three_seconds_is_none():
    stand = judge(np.array([False] * 10 + [True] * 300), PERIOD)
    assert not stand.stood
    assert np.isnan(stand.start_time)


def test_one_broken_sample_starts_the_hold_anew():
    upright = np.array([True] * 400 + [False] + [True] * 200)
    assert not judge(upright, PERIOD).stood


def test_a_robot_that_stood_and_fell_did_not_rise():
    upright = np.array([True] * 1000 + [False] * 5)
    assert not judge(upright, PERIOD).stood


def test_hold_time_is_the_shared_definition():
    assert HOLD_TIME == 3.0


@pytest.mark.parametrize(
    ("neck_share", "tilt_deg", "foreign", "expected"),
    [
        (1.0, 0.0, False, True),
        (0.91, 14.0, False, True),
        (0.89, 0.0, False, False),  # crouching
        (1.0, 16.0, False, False),  # leaning
        (1.0, 0.0, True, False),  # propped on a hand
        (0.66, 0.0, False, False),  # sitting
    ],
)
def test_only_an_upright_robot_on_its_feet_stands(robot, neck_share, tilt_deg, foreign, expected):
    upright = is_upright(
        np.array([neck_share * robot.standing_neck_height]),
        np.array([np.radians(tilt_deg)]),
        np.array([foreign]),
        robot,
    )
    assert upright.tolist() == [expected]
