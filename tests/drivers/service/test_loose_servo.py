"""A servo on a port: found by its id, read and written by the names of its registers."""

import pytest
from desk import BAUD

from drivers.dynamixel.control_table import table_named
from drivers.errors import DriverError, SetupError
from drivers.service.loose_servo import MOTION, find_servo, find_servos, open_servo


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


def test_a_servo_that_falls_silent_is_an_error_of_hardware(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    desk.virtual.servos[0].powered = False
    with pytest.raises(DriverError, match="silent when id is read"):
        servo.read("id")


def test_a_restart_clears_the_error_for_which_a_servo_is_off(desk, bus):
    servo = find_servo(bus, 3, (BAUD,))
    desk.poke("servo_3", "hardware_error_status", 32)
    assert servo.read("hardware_error_status") == 32
    assert servo.reboot().read("hardware_error_status") == 0
