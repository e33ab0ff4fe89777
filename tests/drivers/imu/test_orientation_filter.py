"""The orientation filter against motions whose truth is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Command, SafetyGuard, Twin
from drivers.imu.fusion import GRAVITY, OrientationFilter, upright_from
from robots import quaternion

UP = np.array([0.0, 0.0, GRAVITY])
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
