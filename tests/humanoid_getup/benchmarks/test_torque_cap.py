"""Torque caps: shares of a robot's own servos, whatever they are."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.benchmarks.whole import SHARES, make_caps
from robots import Robot


def with_stall(robot: Robot, stall: float) -> Robot:
    """Give all servos another stall torque [N·m]."""
    joints = [
        replace(
            joint,
            servo=replace(joint.servo, model=replace(joint.servo.model, stall_torque=stall)),
        )
        for joint in robot.joints
    ]
    return replace(robot, joints=tuple(joints))


def test_the_caps_of_op3_are_those_of_the_other_benchmarks(op3: Robot):
    caps = make_caps(op3)
    assert [cap.limit.value for cap in caps] == [None, 2.99, 2.5, 2.01]
    assert [cap.name for cap in caps] == ["stall torque", "73%", "61%", "49%"]
    assert {cap.limit.by for cap in caps} == {op3.limit_by}


@given(stall=st.floats(0.1, 50.0), by=st.sampled_from(["current", "pwm", "ideal"]))
def test_a_cap_is_the_share_that_it_says_of_any_servo(tiny: Robot, stall: float, by):
    caps = make_caps(with_stall(tiny, stall), by)
    assert caps[0].limit.value is None
    for cap, share in zip(caps[1:], SHARES[1:], strict=True):
        assert cap.limit.value == pytest.approx(share * stall, rel=0.005)
        assert cap.limit.by == by


def test_a_gear_counts_where_the_torque_acts(geared: Robot):
    strongest = float(geared.max_torque.max())
    assert strongest > 4.1
    assert make_caps(geared)[-1].limit.value == pytest.approx(0.49 * strongest, rel=0.005)
