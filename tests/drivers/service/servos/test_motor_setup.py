"""The servos of a robot get their ids one at a time."""

import pytest
from desk import BAUD, make_desk, opening, serving_desk

from drivers.errors import SetupError
from drivers.service.servos.loose_servo import NoServoError
from drivers.service.servos.motor_setup import list_joints, set_up_servo

ROBOT = make_desk((4, "XL430-W250"), (5, "XM430-W350"), baud=2_000_000)


def test_a_servo_as_shipped_gets_the_id_and_the_baud_rate_of_its_joint():
    with serving_desk((1, "XM430-W350")) as served, opening(served) as bus:
        done = set_up_servo(bus, ROBOT, ROBOT.joints[1])
        assert (done.old_id, done.old_baud) == (1, BAUD)
        assert done.is_changed(2_000_000)
        assert served.peek("id") == [5]
        assert served.peek("baud_rate") == [4]
        again = set_up_servo(bus, ROBOT, ROBOT.joints[1])
        assert not again.is_changed(2_000_000)


def test_another_model_than_that_of_the_joint_is_refused_and_left_as_it_is():
    with serving_desk((1, "XM430-W350")) as served, opening(served) as bus:
        with pytest.raises(SetupError, match=r"XM430-W350 .* is on the bus, expected a XL430-W250"):
            set_up_servo(bus, ROBOT, ROBOT.joints[0])
        assert served.peek("id") == [1]


def test_two_servos_on_the_bus_are_refused_and_left_as_they_are():
    with serving_desk() as served, opening(served) as bus:
        with pytest.raises(NoServoError, match="servos 1, 3 reply, expected one"):
            set_up_servo(bus, ROBOT, ROBOT.joints[0])
        assert served.peek("id") == [1, 3]


def test_joints_come_from_the_ends_of_the_limbs_or_as_they_are_named():
    assert [joint.servo.id for joint in list_joints(ROBOT)] == [5, 4]
    assert [joint.servo.id for joint in list_joints(ROBOT, ("servo_4",))] == [4]
    with pytest.raises(SetupError, match="unknown joint 'tail', expected servo_4, servo_5"):
        list_joints(ROBOT, ("tail",))
