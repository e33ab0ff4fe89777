"""Modes of a torque limit on servos: what the driver sets, and what the servos then do."""

from dataclasses import replace

import pytest
from memory_rig import Rig

from drivers import Command
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.control_table import OperatingMode
from drivers.errors import SetupError
from drivers.virtual_bus.devices.sensors import Measured
from robots import Robot
from robots.description.servo_catalog import servo_models
from robots.servo import TICKS_PER_TURN, LimitMode


@pytest.mark.parametrize(
    ("by", "mode", "d_gain"),
    [
        ("current", OperatingMode.CURRENT_BASED_POSITION, 4506),
        ("pwm", OperatingMode.EXTENDED_POSITION, 0),
    ],
)
def test_the_driver_sets_the_mode_and_its_damping(tiny: Robot, by, mode, d_gain):
    with Rig(tiny, limit_by=by) as rig:
        assert rig.backend.limit_by == by
        assert rig.peek("operating_mode") == [mode] * 2
        assert rig.peek("position_d_gain") == [d_gain] * 2


@pytest.mark.parametrize("by", ["current", "pwm"])
def test_torque_begins_where_a_joint_is_that_was_turned_around(tiny: Robot, by: LimitMode):
    """The servo counts the turn, and a goal without it would be a turn away."""
    with Rig(tiny, limit_by=by) as rig:
        rig.backend.close()
        before = rig.peek("present_position")[0]
        rig.servo("l_hip").sense(Measured(ticks=before + TICKS_PER_TURN))
        rig.backend.connect()
        angles = rig.backend.read().joint_pos
        assert angles[0] == pytest.approx(tiny.joints[0].servo.to_rad(before), abs=0.002)
        rig.backend.write(Command.position(tiny, angles))
        assert rig.peek("goal_position")[0] == pytest.approx(before + TICKS_PER_TURN, abs=1)
        assert rig.peek("torque_enable") == [1, 1]


def test_servos_without_current_sensor_have_no_current_mode(tiny: Robot):
    model = servo_models()["XL430-W250"]
    joints = tuple(replace(j, servo=replace(j.servo, model=model)) for j in tiny.joints)
    robot, ports = replace(tiny, joints=joints, limit_by="pwm"), {"main": "main"}
    assert DynamixelBackend(robot, ports).limit_by == "pwm"
    with pytest.raises(SetupError, match=r"'current', expected 'pwm': the XL430-W250 of joint"):
        DynamixelBackend(robot, ports, limit_by="current")
