"""Profiles: every trajectory ends at its goal, and on the way keeps what was asked of it."""

import itertools

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from nonempty import nonempty

from drivers.virtual_bus.devices.profile import (
    ProfileShape,
    ProfileTrajectory,
    plan_by_velocity,
)

ticks = st.floats(-4096.0, 4096.0)
speeds = st.floats(-2000.0, 2000.0)
START = 5.0


def sample(path: ProfileTrajectory, count: int = 200) -> list[tuple[float, float, float]]:
    """Time, position and velocity from start to end."""
    times = [START + (path.end - START) * i / count for i in range(count + 1)]
    return [(t, *path.at(t)) for t in times]


@given(position=ticks, velocity=speeds, goal=ticks, top=st.floats(10, 3000), a=st.floats(50, 2e4))
def test_a_path_ends_at_rest_at_its_goal_and_is_never_faster_or_rougher_than_allowed(
    position, velocity, goal, top, a
):
    path = plan_by_velocity(START, position, velocity, goal, top, a)
    assert path.at(path.end) == path.at(path.end + 100.0) == (goal, 0.0)
    where, speed = path.at(path.end - 1e-6)
    assert where == pytest.approx(goal, abs=0.05)
    assert abs(speed) <= a * 1e-5 + 1e-6
    assume(path.end > START)
    points = sample(path)
    step = points[1][0] - points[0][0]
    fastest = max(top, abs(velocity))
    for (_, x0, v0), (_, x1, v1) in nonempty(itertools.pairwise(points)):
        assert abs(v1) <= fastest * (1 + 1e-9)
        assert abs(v1 - v0) <= a * step * (1 + 1e-6) + 1e-6
        # Velocity is the slope of position: within a step it is between its ends, or bends once.
        assert abs((x1 - x0) - 0.5 * (v0 + v1) * step) <= a * step * step + 1e-6


@given(goal=st.floats(1.0, 4096.0), top=st.integers(1, 500), a=st.integers(1, 500))
def test_the_ramp_lasts_64_ms_times_velocity_over_acceleration(goal: float, top: int, a: int):
    """The e-manual's t1 = 64 V / A [ms], V and A in counts of 0.229 rpm and 214.577 rev/min²."""
    v, acceleration = top * 0.229 * 4096 / 60, a * 214.577 * 4096 / 3600
    path = plan_by_velocity(0.0, 0.0, 0.0, goal, v, acceleration)
    if path.shape is ProfileShape.TRAPEZOID:
        assert path.speed_up == pytest.approx(0.064 * top / a, rel=1e-3)
        assert path.end == pytest.approx(goal / v + path.speed_up)  # a trapezoid's area
    else:
        assert path.shape is ProfileShape.TRIANGLE
        assert path.end == pytest.approx(2.0 * (goal / acceleration) ** 0.5)


def test_without_velocity_it_is_a_step_and_without_acceleration_a_rectangle():
    path = plan_by_velocity(1.0, 0.0, 0.0, 9.0, 0.0, 5.0)
    assert (path.shape, path.at(1.0)) == (ProfileShape.STEP, (9.0, 0.0))
    path = plan_by_velocity(0.0, 100.0, 0.0, -100.0, 50.0, 0.0)
    assert (path.shape, path.end, path.at(1.0)) == (ProfileShape.RECTANGLE, 4.0, (50.0, -50.0))
