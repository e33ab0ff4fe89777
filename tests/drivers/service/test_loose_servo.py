"""A servo on a port: found by its id, read and written by the names of its registers."""

import pytest
from desk import BAUD

from drivers.dynamixel.control_table import table_named
from drivers.errors import DriverError, SetupError
from drivers.service.loose_servo import MOTION, find_servo, find_servos, open_servo


def test_a_servo_is_found_by_its_id_at_the_baud_rate_that_it_has(desk):
    with open_servo(desk.path, 3, None) as servo:
        assert (servo.id, servo.table.model, servo.bus.port.baud) == (3, "XM430-W350", BAUD)


def test_the_only_servo_needs_no_id_and_one_of_several_does(bus):
    with pytest.raises(SetupError, match="servos 1, 3 reply, expected --id"):
        find_servo(bus, None, (BAUD,))
    assert [servo.id for servo in find_servos(bus, (BAUD,))] == [1, 3]


def test_a_servo_that_is_not_there_is_named_with_the_rates_that_were_tried(desk):
    with (
        pytest.raises(SetupError, match=f"no servo of id 7 replies at {BAUD} bit/s"),
        open_servo(desk.path, 7, BAUD),
    ):
        pass


def test_servos_are_found_by_their_ids_and_those_that_are_silent_are_named(bus):
    assert [servo.id for servo in find_servos(bus, (BAUD,), (3,))] == [3]
    with pytest.raises(SetupError, match=f"no servo of id 7, 8 replies at {BAUD} bit/s"):
        find_servos(bus, (BAUD,), (8, 1, 7))


def test_a_baud_rate_that_no_servo_has_is_refused_before_the_port_is_opened():
    with pytest.raises(SetupError, match="baud is 1 bit/s"), open_servo("none", 1, 1):
        pass


def test_every_register_that_is_listed_can_be_read_alone(bus):
    servo = find_servo(bus, 3, (BAUD,))
    values = servo.read_table()
    assert len(values) > 50
    still = [name for name in values if not name.startswith(("present_", "realtime"))]
    assert {name: servo.read(name) for name in still} == {name: values[name] for name in still}


def test_a_misspelled_register_is_refused_with_the_nearest_names(bus):
    servo = find_servo(bus, 1, (BAUD,))
    with pytest.raises(SetupError, match="expected present_position"):
        servo.read("presnt_position")


def test_what_is_written_is_read_back_by_any_client(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    servo.write("temperature_limit", 70)
    assert desk.peek("temperature_limit") == [70, 80]


@pytest.mark.parametrize(
    ("register", "value", "expected"),
    [
        ("temperature_limit", 101, r"temperature_limit is 101, expected 0 to 100"),
        ("temperature_limit", -1, r"expected 0 to 100"),
        ("present_position", 0, "can only be read"),
        ("operating_mode", 5, "expected 1, 3, 4, 16"),  # the XL430 has no current mode
        ("id", 9, "getup servo id does that"),
        ("baud_rate", 3, "getup servo baud does that"),
        ("protocol_type", 1, "DYNAMIXEL Wizard does that"),
        ("torque_enable", 1, "which only the guard does"),
        ("indirect_data_1", 1, "which only the guard does"),
        ("indirect_address_1", 116, "which only the guard does"),
        *((name, 1, "may move it, which only the guard does") for name in ("goal_position",)),
    ],
)
def test_a_value_that_may_not_be_written_changes_nothing(
    bus, register: str, value: int, expected: str
):
    servo = find_servo(bus, 1, (BAUD,))
    before = servo.read_table()
    with pytest.raises(SetupError, match=expected):
        servo.write(register, value)
    assert servo.read_table() == before


def test_all_goals_of_all_models_are_for_the_guard_alone():
    for model in ("XL430-W250", "XM430-W350", "XC330-T288"):
        goals = [item.name for item in table_named(model) if item.name.startswith("goal_")]
        assert goals
        assert set(goals) <= set(MOTION)


def test_a_servo_with_torque_takes_torque_off_and_nothing_else(desk, bus):
    servo = find_servo(bus, 1, (BAUD,))
    desk.poke("servo_1", "torque_enable", 1)
    for register in ("position_p_gain", "temperature_limit"):
        with pytest.raises(SetupError, match="has torque, expected none"):
            servo.write(register, 70)
    servo.write("led", 1)
    servo.write("torque_enable", 0)
    servo.write("temperature_limit", 70)
    assert desk.peek("torque_enable") == [0, 0]


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
