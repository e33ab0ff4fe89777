"""Limits of the guard: what they are of a robot, and how torque is derated."""

import numpy as np
import pytest
from memory_rig import Rig

from drivers import Command, SafetyGuard
from drivers.safety_limits import GuardLimits
from robots import Robot


def test_limits_of_a_robot_are_those_of_its_joints_and_servos(tiny: Robot):
    limits = GuardLimits.of(tiny)
    assert np.array_equal(limits.lower, tiny.lower)
    assert np.array_equal(limits.max_velocity, tiny.max_velocity)
    assert np.array_equal(limits.torque_limit, tiny.max_torque)
    # An XM430 switches itself off at 80 °C (e-manual).
    assert np.array_equal(limits.max_temperature, [75.0, 75.0])
    assert np.array_equal(limits.derate_temperature, [65.0, 65.0])
    assert limits.min_voltage == tiny.supply_range[0]


def test_a_torque_limit_holds_where_a_servo_has_more(tiny: Robot):
    assert np.array_equal(GuardLimits.of(tiny, 1.5).torque_limit, [1.5, 1.5])
    assert np.array_equal(GuardLimits.of(tiny, 99.0).torque_limit, tiny.max_torque)
    for wrong in (-0.1, np.inf, np.nan):
        with pytest.raises(ValueError, match=r"torque limit is .* N·m, expected a finite number"):
            GuardLimits.of(tiny, wrong)


def test_torque_falls_from_the_whole_to_two_fifths_over_ten_degrees(tiny: Robot):
    limits = GuardLimits.of(tiny, 2.0)
    for degrees, torque in ((20.0, 2.0), (65.0, 2.0), (70.0, 1.4), (75.0, 0.8), (99.0, 0.8)):
        assert limits.derate(np.full(2, degrees)) == pytest.approx([torque] * 2)


@pytest.mark.parametrize("limit", [40, 79, 80, 95])
def test_a_guard_goes_by_the_limits_inside_the_servos_where_they_are_the_narrower(tiny, limit):
    rig = Rig(tiny)
    rig.servo("r_hip").poke("temperature_limit", limit)
    rig.servo("r_hip").poke("min_voltage_limit", 112)
    own = GuardLimits.of(tiny)
    with SafetyGuard(rig.backend) as guard:
        lowest = min(limit, 80)
        assert guard.limits.max_temperature == pytest.approx([75.0, lowest - 5.0])
        assert guard.limits.derate_temperature == pytest.approx([65.0, lowest - 15.0])
        assert (own.min_voltage, guard.limits.min_voltage) == (10.0, 11.2)
    rig.poke("temperature_limit", 80)
    rig.poke("min_voltage_limit", 95)
    with guard:
        assert guard.limits.max_temperature == pytest.approx(own.max_temperature)
        assert guard.limits.min_voltage == own.min_voltage, "a limit that was set back stays"


def test_a_servo_is_released_before_it_switches_itself_off(tiny):
    rig = Rig(tiny)
    rig.servo("r_hip").poke("temperature_limit", 50)
    with SafetyGuard(rig.backend) as guard:
        limits = []
        for degrees in (34.0, 40.0, 46.0):
            rig.virtual.physics.heat(2, degrees)
            for _ in range(20):  # one slow value of one servo a cycle
                state = guard.read()
                sent = guard.write(Command.position(tiny, state.joint_pos))
            limits.append(sent.torque_limit[1] / tiny.max_torque[1])
        assert limits == pytest.approx([1.0, 0.7, 0.0], abs=0.01)
        assert str(guard.fault) == (
            "a servo is too hot: joint 'r_hip' has 46 °C, expected at most 45 °C"
        )
        assert not any(servo.peek("hardware_error_status") for servo in rig.virtual.servos)
