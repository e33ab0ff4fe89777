"""Running outcomes: runs that are judged piece by piece end as they do judged as a whole."""

import numpy as np
import pytest
from records import make_record

from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import join_records
from robots import Robot
from sim2real.policy_evaluation import RunningOutcome

PERIOD, COUNT = 0.01, 500


@pytest.mark.parametrize("piece", [1, 4, 250])
def test_pieces_are_judged_as_the_whole_is(op3: Robot, piece: int):
    rng = np.random.default_rng(0)
    upright = np.ones((3, COUNT), dtype=bool)
    upright[0, :120] = upright[1, -9] = False
    arrays = {
        "upright": upright,
        "torque": rng.normal(size=(3, COUNT, op3.n)),
        "actuator_vel": rng.normal(size=(3, COUNT, op3.n)),
        "joint_vel": rng.normal(size=(3, COUNT, op3.n)),
        "head_touch": rng.random((3, COUNT)) < 0.3,
        "head_speed": rng.random((3, COUNT)),
    }
    whole = Outcome(make_record(op3, (3, COUNT), PERIOD, **arrays), op3)
    running = RunningOutcome(op3)
    for first in range(0, COUNT, piece):
        part = {name: array[:, first : first + piece] for name, array in arrays.items()}
        running.add(make_record(op3, (3, piece), PERIOD, **part))
    figures = running.conclude()
    assert figures.stood.tolist() == [True, False, True]
    for name in (
        "stood",
        "stand_time",
        "peak_torque",
        "peak_braking_torque",
        "rms_torque",
        "head_impact",
    ):
        np.testing.assert_array_equal(getattr(figures, name), getattr(whole, name), name)
    speed = np.sqrt(np.mean(arrays["joint_vel"][:, -200:] ** 2, axis=(1, 2)))
    assert figures.standing_speed == pytest.approx([speed[0], np.nan, speed[2]], nan_ok=True)


def test_a_run_that_diverged_late_never_stood(op3: Robot):
    running = RunningOutcome(op3)
    for diverged in ([False, False], [False, True], [False, False]):
        running.add(make_record(op3, (2, 200), PERIOD, diverged=np.array(diverged)))
    figures = running.conclude()
    assert figures.stood.tolist() == [True, False]
    assert not figures.upright[1].any()


def test_a_robot_whose_physics_diverged_is_upright_in_no_piece(tiny: Robot):
    sound = make_record(tiny, (3, 4), PERIOD)
    broken = make_record(tiny, (3, 4), PERIOD, diverged=np.array([False, True, False]))
    whole = join_records([sound, broken, sound])
    assert whole.diverged.tolist() == [False, True, False]
    assert whole.upright.all(axis=1).tolist() == [True, False, True]
    assert whole.upright.any(axis=1).tolist() == [True, False, True]
    assert whole.stance.non_foot_contact.all(axis=1).tolist() == [False, True, False]
    assert whole.stance.non_foot_contact.any(axis=1).tolist() == [False, True, False]
