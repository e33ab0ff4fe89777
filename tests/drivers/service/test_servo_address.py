"""Id, baud rate and factory reset of one servo; the servos of a robot, one at a time."""

import pytest
from desk import BAUD, make_desk, opening, serving_desk

from drivers.dynamixel.protocol2 import Reset
from drivers.errors import SetupError
from drivers.service.loose_servo import find_servo, find_servos
from drivers.service.servo_address import change_baud, change_id, reset_servo, set_up_servo
from drivers.virtual_bus.devices.servo import VirtualServo


def test_a_servo_with_a_new_id_replies_there_and_no_longer_at_the_old_one(desk, bus):
    servo = change_id(find_servo(bus, 1, (BAUD,)), 9)
    assert servo.id == servo.read("id") == 9
    assert [found.id for found in find_servos(bus, (BAUD,))] == [3, 9]
    assert desk.peek("id") == [9, 3]


def test_an_id_or_baud_rate_that_is_taken_or_does_not_exist_is_refused(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    for change, new, expected in (
        (change_id, 3, "a device has the id 3"),
        (change_id, 253, "expected 0 to 252"),
        (change_id, -1, "to 252"),
        (change_baud, 250_000, "baud rate is 250000 bit/s, expected 9600, 57600"),
    ):
        with pytest.raises(SetupError, match=expected):
            change(servo, new)
    assert (desk.peek("id"), bus.port.baud) == ([1, 3], BAUD)


def test_two_servos_of_one_id_do_not_both_get_the_new_one(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    twin = VirtualServo(1, "XL430-W250", baud=BAUD)
    twin.poke("present_temperature", 31)
    desk.add(twin)
    with pytest.raises(SetupError, match="garbled, as by two servos of one id"):
        change_id(servo, 9)
    assert desk.peek("id") == [1, 3]
    assert twin.peek("id") == 1


def test_a_servo_at_a_new_baud_rate_replies_there_and_no_longer_at_the_old_one(bus):
    servo = change_baud(find_servo(bus, 1, (BAUD,)), 2_000_000)
    assert servo.bus.port.baud == 2_000_000
    assert servo.read("baud_rate") == 4
    assert [found.id for found in find_servos(bus, (BAUD,))] == [3]
    assert [found.id for found in find_servos(bus, (2_000_000,))] == [1]


def test_neither_id_nor_baud_rate_changes_under_torque(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    desk.poke("servo_1", "torque_enable", 1)
    for change, value in ((change_id, 9), (change_baud, 57_600), (reset_servo, Reset.ALL_BUT_ID)):
        with pytest.raises(SetupError, match="has torque, expected none"):
            change(servo, value)
    assert (servo.read("id"), servo.read("baud_rate")) == (1, 3)


@pytest.mark.parametrize(
    ("kept", "place"),
    [
        (Reset.ALL_BUT_ID_AND_BAUD, (3, BAUD)),
        (Reset.ALL_BUT_ID, (3, 57_600)),
        (Reset.ALL, (5, 57_600)),
    ],
)
def test_a_reset_keeps_what_it_says_and_the_servo_is_found_again(bus, kept, place):
    if kept is Reset.ALL:  # whose id would be that of the other one
        with pytest.raises(SetupError, match="a device has the id 1"):
            reset_servo(find_servo(bus, 3, (BAUD,)), kept)
        change_id(find_servo(bus, 1, (BAUD,)), 2)
        place = (1, 57_600)
    servo = find_servo(bus, 3, (BAUD,))
    servo.write("temperature_limit", 70)
    again = reset_servo(servo, kept)
    assert (again.id, again.bus.port.baud) == place
    assert again.read("temperature_limit") == 80


# The servos of a robot ---------------------------------------------------------------------------

ROBOT = make_desk((4, "XL430-W250"), (5, "XM430-W350"), baud=2_000_000)


def test_a_servo_as_shipped_gets_the_id_and_the_baud_rate_of_its_joint():
    with serving_desk((1, "XM430-W350")) as served, opening(served) as bus:
        assert set_up_servo(bus, ROBOT, ROBOT.joints[1]) == (1, BAUD)
        assert served.peek("id") == [5]
        assert served.peek("baud_rate") == [4]
        served.poke("servo_1", "torque_enable", 1)  # what is set up already is left alone
        assert set_up_servo(bus, ROBOT, ROBOT.joints[1]) == (5, 2_000_000)


def test_another_model_or_two_servos_are_refused_and_left_as_they_are():
    expected = r"XM430-W350 .* is on the bus, expected a XL430-W250"
    with serving_desk((1, "XM430-W350")) as served, opening(served) as bus:
        with pytest.raises(SetupError, match=expected):
            set_up_servo(bus, ROBOT, ROBOT.joints[0])
        assert served.peek("id") == [1]
    with serving_desk() as served, opening(served) as bus:
        with pytest.raises(SetupError, match="servos 1, 3 reply, expected one"):
            set_up_servo(bus, ROBOT, ROBOT.joints[0])
        assert served.peek("id") == [1, 3]
