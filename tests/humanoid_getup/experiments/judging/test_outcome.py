"""Every figure of an outcome, worked out by hand on records of runs that never were."""

from dataclasses import make_dataclass
from typing import Any

import numpy as np
import pytest
from records import make_record

from humanoid_getup.experiments.judging.outcome import (
    DEEP_OVERLAP,
    FIGURES,
    LIMIT_SLACK,
    Outcome,
    count_episodes,
)
from humanoid_getup.experiments.judging.standing import Stance
from humanoid_getup.experiments.judging.torque import LONG_SATURATION
from robots import Robot
from robots.quaternion import from_axis_angle

PERIOD = 0.01


def judge(robot: Robot, count: int, *leading: int, **changes: Any) -> Outcome:
    return Outcome(make_record(robot, (*leading, count), PERIOD, **changes), robot)


def lying(count: int, *leading: int) -> np.ndarray:
    return np.zeros((*leading, count), dtype=bool)


def stance(robot: Robot, height: np.ndarray, tilt: float = 0.0, touch: bool = False) -> Stance:
    """Make a stance of a neck at shares of its standing height, (..., T)."""
    return Stance(
        neck_height=height * robot.standing_neck_height,
        tilt=np.full(height.shape, tilt),
        sole_rise=np.zeros(height.shape),
        non_foot_contact=np.full(height.shape, touch),
    )


def random_changes(robot: Robot, *shape: int) -> dict[str, Any]:
    """Make changes that give every figure something to say, (..., T)."""
    rng = np.random.default_rng(1)
    joints = (*shape, robot.n)
    upright = np.ones(shape, dtype=bool)
    upright[..., :120] = rng.random((*shape[:-1], 120)) < 0.5
    upright[0, 0, -4] = False
    cycles = np.full(shape[:-1], shape[-1])
    cycles[0, 1], cycles[1, 0] = 300, 390
    return {
        "upright": upright,
        "cycles": cycles,
        "stance": stance(robot, rng.random(shape), 0.3),
        "qpos": rng.normal(0.0, 3.0, (*shape, 7 + robot.n)),
        "joint_vel": rng.normal(size=joints),
        "actuator_vel": rng.normal(size=joints),
        "torque": rng.normal(0.0, 3.0, joints),
        "neck": rng.random((*shape, 3)),
        "overlap": 2.0 * DEEP_OVERLAP * rng.random(shape),
        "ground_depth": rng.normal(size=shape),
        "head_touch": rng.random(shape) < 0.3,
        "head_speed": rng.random(shape),
        "torso_touch": rng.random(shape) < 0.3,
        "torso_speed": rng.random(shape),
    }


def figures_of(outcome: Outcome) -> dict[str, Any]:
    return {name: getattr(outcome, name) for name in (*FIGURES.values(), "progress", "saturation")}


def test_a_run_among_others_has_the_figures_that_it_has_alone(tiny: Robot):
    shape = (2, 3, 430)
    together = judge(tiny, 430, 2, 3, **random_changes(tiny, *shape))
    assert set(together.stood.ravel().tolist()) == {True, False}
    figures = figures_of(together)
    for i, j in np.ndindex(2, 3):
        for key, value in figures_of(together.take(i).take(j)).items():
            np.testing.assert_array_equal(value, figures[key][i][j], key)


def test_what_was_not_observed_has_no_figure_and_what_was_is_a_number(tiny: Robot):
    outcome = judge(tiny, 400, overlap=None, is_sensed=True)
    figures = vars(outcome.figures(make_dataclass("Whole", FIGURES)))
    unknown = {key for key, value in figures.items() if value is None}
    assert unknown == {
        "self_overlap_m",
        "self_collisions",
        "ground_penetrations",
        "head_impact_m_s",
        "torso_impact_m_s",
        "neck_delta_v_m_s",
    }
    assert {type(value) for value in figures.values() if value is not None} == {int, float}
    assert figures["stand_time_s"] == pytest.approx(PERIOD)
    assert outcome.collides is None


def test_progress_is_mostly_how_upright_it_ended_and_partly_how_upright_it_was(tiny: Robot):
    """Of 60 samples, windows of 25 end at 35 and at 60; what is before the first is left out."""
    height = np.repeat([1.0, 0.8, 0.4], [10, 25, 25])
    outcome = judge(tiny, 60, upright=lying(60), stance=stance(tiny, height))
    assert outcome.progress == pytest.approx(0.6 * 0.4 + 0.4 * 0.8)


def test_progress_falls_with_height_tilt_and_contacts(tiny: Robot):
    def of(height: float, tilt: float, touch: bool) -> float:
        bent = stance(tiny, np.full(50, height), tilt, touch)
        return float(judge(tiny, 50, upright=lying(50), stance=bent).progress)

    assert of(0.5, 0.0, False) == pytest.approx(0.5)
    assert of(0.5, np.pi / 3, False) == pytest.approx(0.25)
    assert of(0.5, 0.0, True) == pytest.approx(0.4)
    assert of(1.7, 0.0, False) == pytest.approx(1.0), "not better than upright"
    assert of(0.9, np.pi, False) == of(-0.1, 0.0, False) == 0.0, "upside down, or in a hole"


def test_torque_along_a_motion_drives_and_torque_against_it_brakes(tiny: Robot):
    torque, velocity = np.zeros((4, 2)), np.ones((4, 2))
    torque[1], torque[2], torque[3] = [1.5, -0.5], [-3.0, 0.2], [0.0, -2.5]
    velocity[3, 1] = 0.0  # at rest, a servo holds: that is no braking
    outcome = judge(tiny, 4, torque=torque, actuator_vel=velocity)
    assert outcome.peak_torque == 2.5
    assert outcome.peak_braking_torque == 3.0
    last = judge(tiny, 4, torque=torque[::-1], actuator_vel=velocity[::-1])
    assert (last.peak_torque, last.peak_braking_torque) == (2.5, 3.0)


def test_the_share_of_a_torque_is_that_of_the_servos_own_limit(tiny: Robot):
    record = make_record(tiny, (2,), PERIOD, torque=np.array([[0.0, 1.0], [-1.5, 0.0]]))
    assert Outcome(record, tiny).torque_use == pytest.approx((1.5 / tiny.max_torque).max())
    assert Outcome(record, tiny, torque_limit=2.0).torque_use == pytest.approx(0.75)
    beyond = 2.0 * float(tiny.max_torque.max())  # no servo is stronger than its stall
    assert Outcome(record, tiny, torque_limit=beyond).torque_use == pytest.approx(
        (1.5 / tiny.max_torque).max()
    )


def test_rms_torque_is_that_of_the_way_up(tiny: Robot):
    """It stands from its third sample on: 3, 4 and 0 N·m of two joints come before."""
    torque = np.full((310, 2), 7.0)
    torque[:3] = [[3.0, 0.0], [0.0, 4.0], [0.0, 0.0]]
    upright = np.arange(310) >= 2
    assert judge(tiny, 310, torque=torque, upright=upright).rms_torque == pytest.approx(
        np.sqrt((9.0 + 16.0) / 6.0)
    )


@pytest.mark.parametrize(("extra", "is_long"), [(0, False), (1, True)])
def test_saturation_is_the_longest_time_without_reserve(tiny: Robot, extra: int, is_long: bool):
    """Interrupted once, then without a break until its overload protection may trip."""
    longest = round(LONG_SATURATION / PERIOD) + extra
    torque = np.zeros((200, 2))
    torque[:20, 0] = torque[-longest:, 1] = 0.99
    outcome = judge(tiny, 200, torque=torque * tiny.max_torque)
    assert outcome.saturation == pytest.approx(longest * PERIOD)
    assert outcome.overloaded == is_long


@pytest.mark.parametrize(("beyond", "count", "way"), [(0.98, 0, -1), (1.02, 1, -1), (1.02, 1, 1)])
def test_a_joint_may_leave_its_range_by_what_a_soft_stop_yields(tiny, beyond, count, way):
    qpos = np.zeros((30, 9))
    bound = tiny.upper[1] if way > 0 else tiny.lower[1]
    qpos[12, 8] = bound + way * beyond * LIMIT_SLACK
    assert judge(tiny, 30, qpos=qpos).limit_violations == count


def test_an_overlap_is_a_collision_from_a_tenth_of_a_millimeter_on(tiny: Robot):
    depth = np.zeros((3, 60))
    depth[0, 10:50:13] = 0.00011  # four times, 0.13 s apart
    depth[1, 10:50] = 0.00009
    depth[2, 59] = 0.02
    outcome = judge(tiny, 60, 3, overlap=depth)
    assert outcome.overlap.tolist() == [0.00011, 0.00009, 0.02]
    assert outcome.collides.tolist() == [True, False, True]
    assert np.asarray(outcome.self_collisions).tolist() == [4, 0, 1]


def test_a_fault_counts_once_until_it_stayed_away_long_enough():
    flags = np.zeros((40, 3), dtype=bool)
    flags[[3, 4, 5, 8, 30], 0] = True  # 8 follows 5 within the gap, 30 does not
    flags[[0, 12, 25], 1] = True
    assert count_episodes(flags.T, apart=12).tolist() == [2, 2, 0]


def test_an_impact_is_as_fast_as_what_came_down_was_before_it(tiny: Robot):
    touch = np.array([[1, 1, 0, 0, 1, 0, 1], [1, 1, 1, 1, 1, 1, 1]], dtype=bool)
    speed = np.array([[9.0, 9.0, 0.5, 1.5, 0.1, 0.7, 9.0], [5.0] * 7])
    # The first head leaves the ground and comes back with 1.5 and with 0.7 m/s; the second
    # one lay there all the time. The torso does the same at half the speed.
    outcome = judge(
        tiny, 7, 2, head_touch=touch, head_speed=speed, torso_touch=touch, torso_speed=speed / 2.0
    )
    assert np.asarray(outcome.head_impact).tolist() == [1.5, 0.0]
    assert np.asarray(outcome.torso_impact).tolist() == [0.75, 0.0]


def test_a_knock_is_the_largest_change_of_the_necks_velocity(tiny: Robot):
    """It moves at 1 m/s along x, then at 2 m/s along y: sqrt(5) m/s of change."""
    neck = np.zeros((20, 3))
    neck[:10, 0] = 1.0 * PERIOD * np.arange(10)
    neck[10:, 0] = neck[9, 0]
    neck[10:, 1] = 2.0 * PERIOD * np.arange(1, 11)
    outcome = judge(tiny, 20, neck=neck, upright=lying(20))
    assert outcome.neck_delta_v == pytest.approx(np.sqrt(5.0))
    assert judge(tiny, 2, neck=neck[:2]).neck_delta_v == 0.0


def test_a_detour_is_what_the_torso_turns_beyond_the_direct_way(tiny: Robot):
    """It turns by 90°, back by 60° and on by 30°: 180° in all, 60° directly."""
    angle = np.radians(np.concatenate([np.linspace(0, 90, 91), np.linspace(89, 30, 60)]))
    angle = np.concatenate([angle, np.radians(np.linspace(31, 60, 30))])
    count = len(angle)
    qpos = np.zeros((count, 7 + tiny.n))
    qpos[:, 3:7] = from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
    outcome = judge(tiny, count, qpos=qpos, upright=lying(count))
    assert outcome.detour == pytest.approx(np.radians(120.0), abs=np.radians(12.0))
    direct = judge(tiny, 91, qpos=qpos[:91], upright=lying(91))
    assert direct.detour == pytest.approx(0.0, abs=1e-6)


def test_height_is_lost_where_the_neck_sinks_before_the_stand(tiny: Robot):
    height = np.concatenate([np.linspace(0.2, 0.8, 100), np.linspace(0.8, 0.5, 100)])
    risen = np.concatenate([height, np.linspace(0.5, 1.0, 100), np.linspace(1.0, 0.9, 400)])
    upright = np.arange(700) >= 300
    outcome = judge(tiny, 700, stance=stance(tiny, risen), upright=upright)
    assert outcome.height_lost == pytest.approx(0.3, abs=0.03), "not what it sways in the stand"
    assert judge(tiny, 0).height_lost == judge(tiny, 0).detour == 0.0
