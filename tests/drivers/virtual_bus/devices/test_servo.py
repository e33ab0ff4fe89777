"""A virtual servo's registers: who may write what, when, and what a status says of it."""

import re
import struct
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty
from wire_talk import read, sense, write

from drivers.dynamixel.control_table import DriveMode, OperatingMode, known_models, table_named
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction, Reset, Status
from drivers.virtual_bus.devices.device import Quirks
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.servo import VirtualServo

MODELS = [name for name in known_models() if table_named(name).has_watchdog]


def tell(servo: VirtualServo, instruction: int, params: bytes = b"") -> Status:
    status = servo.handle(instruction, params)
    assert status is not None
    return status


def raw_write(servo: VirtualServo, address: int, data: bytes) -> int:
    return tell(servo, Instruction.WRITE, address.to_bytes(2, "little") + data).error


def raw_read(servo: VirtualServo, address: int, length: int) -> tuple[int, bytes]:
    status = tell(servo, Instruction.READ, struct.pack("<HH", address, length))
    return status.error, status.data


def wake(servo: VirtualServo, at: float = 10.0) -> None:
    servo.advance(servo.now + at)
    assert servo.listens


def test_servos_come_with_the_defaults_of_their_tables_and_without_an_error():
    measured = {"present_input_voltage", "present_temperature", "present_position", "moving_status"}
    for model in nonempty(MODELS):
        servo = VirtualServo(7, model, firmware=52)
        given = {"id": 7, "firmware_version": 52}
        items = [i for i in servo.table if i.default is not None and i.name not in measured]
        assert len(items) > 50
        for item in items:
            assert servo.peek(item.name) == given.get(item.name, item.default), item.name
        assert read(servo, "present_position") == read(servo, "goal_position") == 2048
        servo.advance(1.0)
        assert read(servo, "hardware_error_status") == 0, model


def test_every_item_has_its_access_and_its_range():
    """Write the least, the greatest, and one beyond each, of every item, torque off."""
    alike, seen = re.compile(r"indirect_\w+_(?!1$)\d+"), set()  # as the first of them
    for model in nonempty(MODELS):
        new = {item for item in table_named(model, 46) if not alike.match(item.name)} - seen
        seen |= new
        for item in nonempty(new):
            where, servo = (model, item.name), VirtualServo(1, model, firmware=46)
            if not item.writable:
                assert write(servo, item.name, 0) == ErrorNumber.ACCESS, where
                continue
            before = servo.peek(item.name)
            for bound, step in nonempty(zip((item.lower, item.upper), (-1, 1), strict=True)):
                try:
                    beyond = item.encode(bound + step)
                except OverflowError:  # no such value fits into the item
                    continue
                assert raw_write(servo, item.address, beyond) == ErrorNumber.DATA_RANGE, where
                assert servo.peek(item.name) == before, where
            for bound in nonempty((item.lower, item.upper)):
                servo = VirtualServo(1, model, firmware=46)
                error, expected = write(servo, item.name, bound), find_error(item, bound)
                assert error == expected, (where, bound)
                assert error or servo.peek(item.name) == bound


def find_error(item, bound: int) -> int:
    if item.name in ("goal_velocity", "goal_position"):
        return ErrorNumber.DATA_LIMIT  # the limits that apply now are narrower than the range
    # Modes that are not modelled, or that it lacks; it speaks Protocol 2.0 alone.
    lacks = {"operating_mode": True, "drive_mode": bound != 0, "protocol_type": bound == 1}
    return ErrorNumber.DATA_RANGE if lacks.get(item.name) else 0


def test_a_write_is_done_whole_or_not_at_all():
    servo = VirtualServo(1)
    before = raw_read(servo, 64, 83)
    for address, data, error in (
        (116, b"\x00\x08", ErrorNumber.DATA_LENGTH),  # half a goal
        (118, b"\x00\x00", ErrorNumber.DATA_LENGTH),
        (116, b"", ErrorNumber.DATA_LENGTH),
        (112, b"\x10\0\0\0\x00\x08", ErrorNumber.DATA_LENGTH),
        (100, b"\x01\x00\xff\x7f", ErrorNumber.DATA_RANGE),  # the second of two items
        (15, b"\0", ErrorNumber.ACCESS),  # a gap
        (132, b"\0\0\0\0", ErrorNumber.ACCESS),
    ):
        assert raw_write(servo, address, data) == error
        assert raw_read(servo, 64, 83) == before
    assert raw_write(servo, 100, b"\x2c\x01\x64\x00") == 0
    assert (servo.peek("goal_pwm"), servo.peek("goal_current")) == (300, 100)


def test_reads_may_cross_a_gap_and_not_leave_the_table():
    servo = VirtualServo(1)
    for span in ((servo.table.size, 1), (0, servo.table.size + 1), (0xFFFF, 0xFFFF), (15, 2)):
        assert raw_read(servo, *span) == (ErrorNumber.ACCESS, b""), span
    assert raw_read(servo, 132, 0) == (ErrorNumber.DATA_LENGTH, b"")
    assert raw_write(servo, 65, b"\1\7\7\2") == 0
    assert raw_read(servo, 65, 4) == (0, b"\1\0\0\2"), "led, a gap, status return level"
    for instruction in (0x00, 0x07, 0x77, Instruction.SYNC_WRITE, Instruction.ACTION):
        assert tell(servo, instruction).number == ErrorNumber.INSTRUCTION


def test_data_limit_error_for_goals_beyond_a_configured_limit():
    servo = VirtualServo(1)
    for quantity, value in nonempty({"pwm": 500, "current": 300, "velocity": 100}.items()):
        goal = f"goal_{quantity}"
        assert write(servo, f"{quantity}_limit", value) == 0
        assert write(servo, goal, value) == write(servo, goal, -value) == 0
        assert write(servo, goal, value + 1) == ErrorNumber.DATA_LIMIT
        assert servo.peek(goal) == -value
    assert write(servo, "min_position_limit", 1000) == 0
    assert write(servo, "max_position_limit", 3000) == 0
    assert write(servo, "goal_position", 999) == ErrorNumber.DATA_LIMIT
    assert write(servo, "goal_position", 3001) == ErrorNumber.DATA_LIMIT
    assert servo.peek("goal_position") == 2048
    assert write(servo, "goal_position", 1000) == write(servo, "goal_position", 3000) == 0


def test_torque_locks_eeprom_and_nothing_else():
    servo = VirtualServo(1)
    assert write(servo, "torque_enable", 1) == 0
    locked = [item for item in servo.table if item.eeprom and item.writable]
    assert len(locked) == 19
    for item in locked:
        assert write(servo, item.name, servo.peek(item.name)) == ErrorNumber.ACCESS
    assert write(servo, "position_p_gain", 400) == 0
    assert write(servo, "torque_enable", 0) == 0
    assert write(servo, "return_delay_time", 0) == 0


def test_status_return_level_decides_what_is_answered():
    servo = VirtualServo(3, "XM540-W270", firmware=45)
    told = ((1, b""), (2, b"\x84\0\4\0"), (3, b"\x41\0\1"))  # ping, read, write the led
    answered = {}
    for level in (0, 1, 2):
        servo.poke("status_return_level", level)
        answers = [servo.handle(*each) for each in told]
        answered[level] = [answer is not None for answer in answers]
        assert answers[0] == Status(3, 0, b"\x60\x04\x2d"), "1120, 45"
    assert answered == {0: [True, False, False], 1: [True, True, False], 2: [True, True, True]}
    assert servo.peek("led") == 1  # obeyed all the same


def test_a_registered_write_is_judged_when_it_comes_and_forgotten_by_a_reboot():
    servo = VirtualServo(1)
    for params, number in (
        (b"\x84\0\0\0\0\0", ErrorNumber.ACCESS),
        (b"\x41\0\2", ErrorNumber.DATA_RANGE),
        (b"\x68\0\1", ErrorNumber.DATA_LENGTH),
        (b"\x74\0\0\x10\0\0", ErrorNumber.DATA_LIMIT),
    ):
        assert tell(servo, Instruction.REG_WRITE, params).number == number
    assert read(servo, "registered_instruction") == 0
    assert tell(servo, Instruction.REG_WRITE, b"\x68\0\x64\0\0\0").error == 0  # goal velocity
    assert (read(servo, "registered_instruction"), read(servo, "goal_velocity")) == (1, 0)
    assert tell(servo, Instruction.ACTION).error == 0
    assert (read(servo, "registered_instruction"), read(servo, "goal_velocity")) == (0, 100)
    servo.handle(Instruction.REG_WRITE, b"\x41\0\1")
    servo.handle(Instruction.REBOOT)
    wake(servo)
    assert tell(servo, Instruction.ACTION).number == ErrorNumber.INSTRUCTION


def test_indirect_data_is_the_register_that_its_address_names():
    servo = VirtualServo(1)
    assert raw_write(servo, 224, bytes(range(28))) == 0, "memory of its own until it is mapped"
    assert raw_read(servo, 224, 28) == (0, bytes(range(28)))
    sense(servo, ticks=1234.0)
    for i in range(4):
        assert write(servo, f"indirect_address_{i + 1}", 132 + i) == 0
        assert write(servo, f"indirect_address_{i + 5}", 116 + i) == 0
    assert raw_read(servo, 224, 8) == (0, (1234).to_bytes(4, "little") + b"\0\x08\0\0")
    assert raw_write(servo, 228, (3000).to_bytes(4, "little")) == 0
    assert read(servo, "goal_position") == 3000
    write(servo, "indirect_address_1", 65)  # counts at once
    assert raw_write(servo, 224, b"\1") == 0
    assert read(servo, "led") == 1
    for i, address in enumerate((116, 117, 118, 119, 132, 65, 66), start=1):
        write(servo, f"indirect_address_{i}", address)
    for address, data, error in (  # the rules of the register behind
        (224, (5000).to_bytes(4, "little"), ErrorNumber.DATA_LIMIT),
        (224, b"\0\0", ErrorNumber.DATA_LENGTH),
        (228, b"\0", ErrorNumber.ACCESS),  # present position
        (229, b"\2", ErrorNumber.DATA_RANGE),  # led
        (230, b"\0", ErrorNumber.ACCESS),  # a gap
    ):
        assert raw_write(servo, address, data) == error
    for address in (63, 662):  # EEPROM, and what is none
        assert write(servo, "indirect_address_1", address) == ErrorNumber.DATA_RANGE


@pytest.mark.parametrize("by_power", [False, True])
def test_a_restart_keeps_eeprom_and_resets_ram(by_power: bool):
    servo = VirtualServo(1, quirks=Quirks(reboot_time=0.3))
    write(servo, "pwm_limit", 600)
    for name, value in (("indirect_address_1", 68), ("position_p_gain", 111), ("torque_enable", 1)):
        write(servo, name, value)
    if by_power:
        servo.powered = False
        assert not servo.listens and not servo.motor_command().torque_on
        servo.advance(5.0)
        servo.powered = True
    else:
        assert tell(servo, Instruction.REBOOT).error == 0
    assert not servo.listens and not servo.torque_on
    servo.advance(servo.now + 0.29)
    assert not servo.listens
    servo.advance(servo.now + 0.02)
    assert servo.listens
    assert read(servo, "pwm_limit") == read(servo, "goal_pwm") == 600
    assert read(servo, "position_p_gain") == 800
    assert read(servo, "indirect_address_1") == 224
    assert read(servo, "torque_enable") == 0
    write(servo, "startup_configuration", 1)
    servo.handle(Instruction.REBOOT)
    assert not servo.motor_command().torque_on
    wake(servo)
    assert servo.motor_command().torque_on and read(servo, "torque_enable") == 1


@pytest.mark.parametrize("kept", Reset)
def test_a_factory_reset_keeps_what_it_is_asked_to(kept: Reset):
    servo = VirtualServo(9, baud=2_000_000)
    write(servo, "return_delay_time", 0)
    for params, number in ((b"\x03", 4), (b"", 5), (b"\x01\x01", 5)):
        assert tell(servo, Instruction.FACTORY_RESET, params).number == number
    assert servo.listens
    assert tell(servo, Instruction.FACTORY_RESET, bytes((kept,))) == Status(9)
    wake(servo)
    assert read(servo, "return_delay_time") == 250
    assert servo.id == (1 if kept is Reset.ALL else 9)
    assert servo.baud == (2_000_000 if kept is Reset.ALL_BUT_ID_AND_BAUD else 57_600)
    assert read(servo, "firmware_version") == 46


@pytest.mark.parametrize("make", [VirtualServo, partial(PlainServo, model="MX-28(1.0)")])
@given(time=st.floats(0.0, 1e5))
def test_the_realtime_tick_counts_milliseconds_and_wraps(make, time):
    servo = make(1)
    servo.advance(time)
    assert servo.peek("realtime_tick") == int(time * 1000.0) % 32768


def test_a_mode_change_brings_back_gains_profile_and_goals():
    servo = VirtualServo(1)
    for name in ("position_p_gain", "velocity_i_gain", "profile_velocity", "profile_acceleration"):
        write(servo, name, 7)
    write(servo, "goal_pwm", 10)
    write(servo, "goal_current", -20)
    assert write(servo, "operating_mode", OperatingMode.EXTENDED_POSITION) == 0
    assert (read(servo, "position_p_gain"), read(servo, "velocity_i_gain")) == (800, 1920)
    assert (read(servo, "profile_velocity"), read(servo, "profile_acceleration")) == (0, 0)
    assert (read(servo, "goal_pwm"), read(servo, "goal_current")) == (885, 1193)
    for mode in (OperatingMode.CURRENT, OperatingMode.VELOCITY, OperatingMode.PWM):
        assert write(servo, "operating_mode", mode) == ErrorNumber.DATA_RANGE, "not modelled"
    assert write(servo, "drive_mode", DriveMode.TIME_BASED) == ErrorNumber.DATA_RANGE
