"""A servo on a port: found, read and written by name; its id and its baud rate."""

import pytest
from desk import BAUD, make_desk, opening, serving_desk

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.protocol2 import Reset
from drivers.errors import DriverError, SetupError
from drivers.service.loose_servo import MOTION, find_servo, find_servos, open_servo
from drivers.service.servo_address import change_baud, change_id, reset_servo, set_up_servo
from drivers.virtual_bus.devices.servo import VirtualServo


def test_a_servo_is_found_by_its_id_at_the_baud_rate_that_it_has(desk):
    with open_servo(desk.path, 3, None) as servo:
        assert (servo.id, servo.table.model, servo.bus.port.baud) == (3, "XM430-W350", BAUD)
    for baud, text in ((BAUD, f"no servo of id 7 replies at {BAUD} bit/s"), (1, "baud is 1 bit/s")):
        with pytest.raises(SetupError, match=text), open_servo(desk.path, 7, baud):
            pass


def test_one_of_several_servos_needs_an_id_and_those_that_are_silent_are_named(bus):
    for ids, found in (((), [1, 3]), ((3,), [3])):
        assert [servo.id for servo in find_servos(bus, (BAUD,), ids)] == found
    with pytest.raises(SetupError, match="servos 1, 3 reply, expected --id"):
        find_servo(bus, None, (BAUD,))
    with pytest.raises(SetupError, match=f"no servo of id 7, 8 replies at {BAUD} bit/s"):
        find_servos(bus, (BAUD,), (8, 1, 7))


def test_every_register_that_is_listed_can_be_read_alone(bus):
    servo = find_servo(bus, 3, (BAUD,))
    values = servo.read_table()
    assert len(values) > 50
    still = [name for name in values if not name.startswith(("present_", "realtime"))]
    assert {name: servo.read(name) for name in still} == {name: values[name] for name in still}


REFUSED = [
    ("temperature_limit", 101, r"temperature_limit is 101, expected 0 to 100"),
    ("temperature_limit", -1, r"expected 0 to 100"),
    ("present_position", 0, "can only be read"),
    ("presnt_position", 0, "expected present_position"),
    ("operating_mode", 5, "expected 1, 3, 4, 16"),  # the XL430 has no current mode
    ("id", 9, "getup servo id does that"),
    ("baud_rate", 3, "getup servo baud does that"),
    ("protocol_type", 1, "DYNAMIXEL Wizard does that"),
    ("torque_enable", 1, "which only the guard does"),
    ("indirect_data_1", 1, "which only the guard does"),
    ("indirect_address_1", 116, "which only the guard does"),
    ("goal_position", 1, "may move it, which only the guard does"),
]


def test_a_value_that_may_not_be_written_changes_nothing(bus):
    servo = find_servo(bus, 1, (BAUD,))
    before = servo.read_table()
    for register, value, expected in REFUSED:
        with pytest.raises(SetupError, match=expected):
            servo.write(register, value)
    assert servo.read_table() == before
    for model in ("XL430-W250", "XM430-W350", "XC330-T288"):
        goals = {item.name for item in table_named(model) if item.name.startswith("goal_")}
        assert goals and goals <= set(MOTION)


def test_a_servo_with_torque_takes_torque_off_and_nothing_else(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    desk.poke("servo_1", "torque_enable", 1)
    for register in ("position_p_gain", "temperature_limit"):
        with pytest.raises(SetupError, match="has torque, expected none"):
            servo.write(register, 70)
    servo.write("led", 1)
    servo.write("torque_enable", 0)
    servo.write("temperature_limit", 70)
    assert (desk.peek("torque_enable"), desk.peek("temperature_limit")) == ([0, 0], [70, 80])


def test_a_restart_clears_the_error_for_which_a_servo_is_off_and_silence_is_one(desk, bus):
    servo = find_servo(bus, 3, (BAUD,))
    desk.poke("servo_3", "hardware_error_status", 32)
    assert servo.read("hardware_error_status") == 32
    assert servo.reboot().read("hardware_error_status") == 0
    desk.virtual.servos[1].powered = False
    with pytest.raises(DriverError, match="silent when id is read"):
        servo.read("id")


# Id, baud rate and factory reset -----------------------------------------------------------------


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
