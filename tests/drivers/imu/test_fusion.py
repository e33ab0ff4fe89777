"""Orientation from samples: their ages, what they stand for, and motions whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Command, SafetyGuard, Twin
from drivers.imu.fusion import (
    FROZEN_CYCLES,
    GRAVITY,
    SINKING_CYCLES,
    ImuFusion,
    OrientationFilter,
    upright_from,
)
from drivers.imu.source import ImuSample
from robots import quaternion

UP = np.array([0.0, 0.0, GRAVITY])


def sample(number: int, gyro: float = 0.0, **fields) -> ImuSample:
    return ImuSample(np.array([0, 0, gyro]), UP, counts=number.to_bytes(4, "little"), **fields)


def tilted(number: int, roll: float = 0.5, **fields) -> ImuSample:
    force = GRAVITY * np.array([0.0, np.sin(roll), np.cos(roll)])
    return ImuSample(np.zeros(3), force, counts=number.to_bytes(4, "little"), **fields)


def roll_of(fusion: ImuFusion) -> float:
    w, x, _, _ = fusion.orientation
    return 2.0 * np.arctan2(x, w)


def test_a_body_that_moved_at_the_start_is_measured_again_once_it_has_rested():
    fusion = ImuFusion(0.008)
    fusion.start(sample(0, gyro=1.0), 0.0)
    measured = []
    for k in range(1, 25):
        fusion.update(tilted(k), 0.008 * k, speed=0.0)
        measured.append(roll_of(fusion) == pytest.approx(0.5))
        if k == 6:  # moves once more: the count starts over
            fusion.update(replace(tilted(99), gyro=np.array([0.3, 0, 0])), 0.049, speed=0.0)
    assert measured.index(True) == 6 + 12 - 1


@pytest.mark.parametrize("force", [0.94, 1.06])
def test_a_body_that_is_pushed_does_not_rest(force: float):
    fusion = ImuFusion(0.008)
    fusion.start(replace(sample(0), accelerometer=force * UP), 0.0)
    for k in range(1, 20):
        pushed = tilted(k)
        fusion.update(replace(pushed, accelerometer=force * pushed.accelerometer), 0.008 * k, 0.0)
    assert roll_of(fusion) < 0.2


def test_a_repeated_sample_counts_while_the_joints_rest_and_not_while_they_move():
    """Eleven repeats may be chance; the twelfth shows that the sensor is frozen since the first."""
    for speed, stamp in ((0.9, 1.5), (1.1, 1.0)):
        fusion = ImuFusion(0.008)
        fusion.start(sample(0), 1.0)
        for k in range(1, 12):
            fusion.update(sample(0), 1.0 + 0.01 * k, speed)
        assert fusion.stamp == pytest.approx(1.11)
        fusion.update(sample(0), 1.5, speed)
        assert fusion.stamp == pytest.approx(stamp)
        fusion.update(sample(1), 1.6, speed)
        assert fusion.stamp == pytest.approx(1.6), "it is believed again"
    for gap, is_measured_again in ((0.9, False), (1.1, True)):  # without a sample
        fusion = ImuFusion(0.008)
        fusion.start(sample(0), 1.0)
        fusion.update(tilted(1), 1.0 + gap, speed=0.0)
        assert (roll_of(fusion) == pytest.approx(0.5)) == is_measured_again


def test_a_limp_arm_may_sink_beside_a_torso_that_rests():
    for is_limp, turn, force, is_believed, what in (
        (True, 0.0, 1.0, True, "a limp arm sinks"),
        (False, 0.0, 1.0, False, "a joint drives"),
        (True, 0.001, 1.0, False, "frozen in a fall"),
        (True, 0.0, 0.0, False, "a sensor that reads zeros"),
    ):
        fusion = ImuFusion(0.008)
        same = replace(sample(0, gyro=turn), accelerometer=force * UP)
        fusion.start(sample(0), 1.0)
        for k in range(1, 41):
            fusion.update(same, 1.0 + 0.008 * k, speed=2.8, is_limp=is_limp)
        assert (1.32 - fusion.stamp < 0.01) == is_believed, what


def test_no_limb_sinks_for_seconds_beside_a_torso_that_rests():
    fusion = ImuFusion(0.008)
    fusion.start(sample(0), 0.0)
    for k in range(1, SINKING_CYCLES + FROZEN_CYCLES + 1):
        assert fusion.stamp == pytest.approx(0.008 * (k - 1))
        fusion.update(sample(0), 0.008 * k, speed=2.8, is_limp=True)
    assert fusion.stamp == 0.0


# The orientation filter --------------------------------------------------------------------------

PERIOD = 0.008


def tilt_between(p, q) -> float:
    """Angle between the verticals that two orientations claim [rad]."""
    cosine = quaternion.gravity_in_body(p) @ quaternion.gravity_in_body(q)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.hypot(*q[:2]) > 0.1)
)
def test_at_rest_the_accelerometer_tells_the_vertical_whatever_the_posture(numbers):
    truth = quaternion.normalize(np.array(numbers))
    accelerometer = quaternion.rotate(quaternion.inverse(truth), UP)
    assert quaternion.gravity_in_body(upright_from(accelerometer)) == pytest.approx(
        quaternion.gravity_in_body(truth), abs=1e-9
    )


def test_a_wrong_estimate_at_rest_decays_with_the_time_constant():
    filter = OrientationFilter(PERIOD, time_constant=1.0)
    filter.start(quaternion.rotate(quaternion.from_axis_angle(np.array([1.0, 0, 0]), 0.1), UP))
    wrong = tilt_between(filter.orientation, quaternion.IDENTITY)
    for _ in range(125):
        filter.update(np.zeros(3), UP, PERIOD)
    left = tilt_between(filter.orientation, quaternion.IDENTITY)
    assert wrong == pytest.approx(0.1)
    assert left == pytest.approx(0.1 * np.exp(-1.0), rel=0.02)


def test_a_turn_is_followed_by_the_gyro_yaw_too():
    filter = OrientationFilter(PERIOD)
    filter.start(UP)
    rate = np.array([0.0, 0.0, 1.0])
    for _ in range(250):
        filter.update(rate, UP, PERIOD)
    assert filter.orientation == pytest.approx(
        quaternion.from_yaw(2.0), abs=1e-5
    )  # single precision


def test_a_robot_that_thrashes_about_knows_its_vertical(op3):
    rng = np.random.default_rng(1)
    phase, rate = rng.uniform(0.0, 2.0 * np.pi, op3.n), rng.uniform(3.0, 19.0, op3.n)

    twin, errors, rates = Twin(op3), [], []
    with SafetyGuard(twin) as guard:
        while (state := guard.read()).time < 3.0:
            swing = 0.5 * np.sin(phase + rate * state.time)
            guard.write(Command.position(op3, op3.standing.joint_pos + swing))
            errors.append(tilt_between(twin.read().orientation, twin.truth.posture.orientation))
            rates.append(np.linalg.norm(state.gyro))
    assert max(rates) > 4.0, "it did not thrash"
    assert np.degrees(max(errors)) < 3.0
