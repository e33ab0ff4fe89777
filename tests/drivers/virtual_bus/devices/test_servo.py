"""A virtual servo's registers: who may write what, when, and what a status says of it."""

from collections.abc import Callable
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty
from wire_talk import read, sense, write

from drivers.dynamixel.control_table import OperatingMode, known_models, table_named
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction, Reset
from drivers.virtual_bus.devices.device import Addressing
from drivers.virtual_bus.devices.maintenance import CLEAR_TURNS, RESTORE_BACKUP, STORE_BACKUP
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.quirks import Quirks, UndefinedRegisters
from drivers.virtual_bus.devices.servo import VirtualServo

MODELS = [name for name in known_models() if table_named(name).has_watchdog]


def raw_write(servo: VirtualServo, address: int, data: bytes) -> int:
    status = servo.handle(Instruction.WRITE, address.to_bytes(2, "little") + data)
    assert status is not None
    return status.error


def raw_read(servo: VirtualServo, address: int, length: int) -> tuple[int, bytes]:
    params = address.to_bytes(2, "little") + length.to_bytes(2, "little")
    status = servo.handle(Instruction.READ, params)
    assert status is not None
    return status.error, status.data


def wake(servo: VirtualServo, at: float = 10.0) -> None:
    """Let a reboot end."""
    servo.advance(servo.now + at)
    assert servo.listens


# As shipped ---------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_a_servo_comes_with_the_defaults_of_its_table(model: str):
    servo = VirtualServo(7, model, firmware=52)
    given = {"id": 7, "firmware_version": 52}
    measured = {"present_input_voltage", "present_temperature", "present_position"}
    checked = 0
    for item in servo.table:
        if item.default is not None and item.name not in measured | {"moving_status"}:
            assert servo.peek(item.name) == given.get(item.name, item.default), item.name
            checked += 1
    assert checked > 50
    assert read(servo, "present_position") == read(servo, "goal_position") == 2048


def test_a_ping_tells_model_and_firmware_at_every_return_level():
    servo = VirtualServo(3, "XM540-W270", firmware=45)
    for level in (2, 1, 0):
        servo.poke("status_return_level", level)
        status = servo.handle(Instruction.PING)
        assert status is not None
        assert (status.id, status.error, status.data) == (3, 0, b"\x60\x04\x2d")  # 1120, 45


# Error numbers ------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_every_item_has_its_access_and_its_range(model: str):
    """Write the least, the greatest, and one beyond each, of every item, torque off."""
    for item in nonempty(table_named(model, 46)):
        servo = VirtualServo(1, model, firmware=46)
        if not item.writable:
            assert write(servo, item.name, 0) == ErrorNumber.ACCESS, item.name
            continue
        before = servo.peek(item.name)
        limits = (item.lower, item.upper)
        for bound, step in nonempty(zip(limits, (-1, 1), strict=True)):
            try:
                beyond = item.encode(bound + step)
            except OverflowError:
                continue  # no such value fits into the item
            assert raw_write(servo, item.address, beyond) == ErrorNumber.DATA_RANGE, item.name
            assert servo.peek(item.name) == before
        for bound in nonempty(limits):
            servo = VirtualServo(1, model, firmware=46)
            error = write(servo, item.name, bound)
            if item.name in ("goal_velocity", "goal_position"):
                # The limits that apply now are narrower than the item's own range.
                assert error == ErrorNumber.DATA_LIMIT
            elif item.name == "operating_mode" and bound not in servo.table.modes:
                assert error == ErrorNumber.DATA_RANGE
            elif item.name == "protocol_type" and bound == 1:
                # A virtual servo speaks Protocol 2.0 alone, and does not pretend otherwise.
                assert error == ErrorNumber.DATA_RANGE
                assert servo.peek(item.name) == 2
            else:
                assert error == 0, (item.name, bound)
                assert servo.peek(item.name) == bound


def test_result_fail_when_turns_are_cleared_in_motion():
    servo = VirtualServo(1)
    sense(servo, velocity=1.0)
    status = servo.handle(Instruction.CLEAR, CLEAR_TURNS)
    assert status is not None and status.number == ErrorNumber.RESULT_FAIL


def test_instruction_error_for_unknown_instructions_and_actions_without_a_write():
    servo = VirtualServo(1)
    for instruction in (0x00, 0x07, 0x77, Instruction.SYNC_WRITE, Instruction.ACTION):
        status = servo.handle(instruction)
        assert status is not None and status.number == ErrorNumber.INSTRUCTION


def test_data_length_error_for_half_an_item():
    servo = VirtualServo(1)
    assert raw_write(servo, 116, b"\x00\x08") == ErrorNumber.DATA_LENGTH
    assert raw_write(servo, 118, b"\x00\x00") == ErrorNumber.DATA_LENGTH  # its second half
    assert raw_write(servo, 116, b"") == ErrorNumber.DATA_LENGTH
    assert raw_write(servo, 112, b"\x10\0\0\0\x00\x08") == ErrorNumber.DATA_LENGTH
    assert servo.peek("goal_position") == 2048 and servo.peek("profile_velocity") == 0


def test_data_limit_error_for_goals_beyond_a_configured_limit():
    servo = VirtualServo(1)
    limits = {"pwm_limit": 500, "current_limit": 300, "velocity_limit": 100}
    for limit, value in limits.items():
        assert write(servo, limit, value) == 0
        goal = limit.replace("limit", "goal").split("_")
        name = f"goal_{goal[0]}"
        assert write(servo, name, value) == write(servo, name, -value) == 0
        assert write(servo, name, value + 1) == ErrorNumber.DATA_LIMIT
        assert servo.peek(name) == -value
    assert write(servo, "min_position_limit", 1000) == 0
    assert write(servo, "max_position_limit", 3000) == 0
    assert write(servo, "goal_position", 999) == ErrorNumber.DATA_LIMIT
    assert write(servo, "goal_position", 3001) == ErrorNumber.DATA_LIMIT
    assert servo.peek("goal_position") == 2048
    assert write(servo, "goal_position", 1000) == write(servo, "goal_position", 3000) == 0


def test_access_error_outside_the_table():
    servo = VirtualServo(1)
    assert raw_read(servo, servo.table.size, 1) == (ErrorNumber.ACCESS, b"")
    assert raw_read(servo, 0, servo.table.size + 1) == (ErrorNumber.ACCESS, b"")
    assert raw_read(servo, 0xFFFF, 0xFFFF) == (ErrorNumber.ACCESS, b"")
    assert raw_read(servo, 15, 2) == (ErrorNumber.ACCESS, b"")  # 14..19 is a gap
    assert raw_write(servo, 15, b"\0") == ErrorNumber.ACCESS
    assert raw_read(servo, 132, 0) == (ErrorNumber.DATA_LENGTH, b"")


def test_a_gap_inside_a_span_is_a_quirk():
    span = (65, 4)  # led, two undefined bytes, status return level
    lenient, strict = (VirtualServo(1, quirks=Quirks(undefined=u)) for u in UndefinedRegisters)
    assert raw_read(lenient, *span) == (0, b"\0\0\0\2")
    assert raw_read(strict, *span) == (ErrorNumber.ACCESS, b"")
    assert raw_write(lenient, 65, b"\1\7\7\2") == 0
    assert raw_read(lenient, *span) == (0, b"\1\0\0\2")
    assert raw_write(strict, 65, b"\1\0\0\2") == ErrorNumber.ACCESS
    assert strict.peek("led") == 0


def test_a_write_over_several_items_is_done_whole_or_not_at_all():
    servo = VirtualServo(1)
    goals = (300).to_bytes(2, "little") + (100).to_bytes(2, "little")
    assert raw_write(servo, 100, goals) == 0
    assert (servo.peek("goal_pwm"), servo.peek("goal_current")) == (300, 100)
    assert raw_write(servo, 100, b"\x01\x00\xff\x7f") == ErrorNumber.DATA_RANGE
    assert (servo.peek("goal_pwm"), servo.peek("goal_current")) == (300, 100)


def test_torque_locks_eeprom_and_nothing_else():
    servo = VirtualServo(1)
    assert write(servo, "torque_enable", 1) == 0
    locked = 0
    for item in servo.table:
        if item.eeprom and item.writable:
            assert write(servo, item.name, servo.peek(item.name)) == ErrorNumber.ACCESS
            locked += 1
    assert locked == 19
    assert write(servo, "position_p_gain", 400) == 0
    assert write(servo, "torque_enable", 0) == 0
    assert write(servo, "return_delay_time", 0) == 0


def test_status_return_level_decides_what_is_answered():
    servo = VirtualServo(1)
    ask = (b"\x84\0\4\0", b"\x41\0\1")  # read the position, write the led
    answered = {}
    for level in (0, 1, 2):
        servo.poke("status_return_level", level)
        answered[level] = [
            servo.handle(instruction, params) is not None
            for instruction, params in zip((2, 3), ask, strict=True)
        ]
    assert answered == {0: [False, False], 1: [True, False], 2: [True, True]}
    assert servo.peek("led") == 1  # obeyed all the same


def test_a_new_id_is_confirmed_under_the_old_one():
    servo = VirtualServo(1)
    status = servo.handle(Instruction.WRITE, b"\x07\0\x09")
    assert status is not None and (status.id, status.error) == (1, 0)
    assert servo.id == 9


def test_drive_mode_takes_only_the_bits_of_its_model():
    servo = VirtualServo(1)
    assert write(servo, "drive_mode", 0b0010) == ErrorNumber.DATA_RANGE  # slave: XM540 only
    assert write(servo, "drive_mode", 0b1101) == 0
    assert write(VirtualServo(1, "XM540-W270"), "drive_mode", 0b0010) == 0


# Registered writes --------------------------------------------------------------------------


def test_a_registered_write_is_judged_when_it_comes():
    servo = VirtualServo(1)
    cases = {
        b"\x84\0\0\0\0\0": ErrorNumber.ACCESS,
        b"\x41\0\2": ErrorNumber.DATA_RANGE,
        b"\x68\0\1": ErrorNumber.DATA_LENGTH,
        b"\x41\0": ErrorNumber.DATA_LENGTH,
        b"\x74\0\0\x10\0\0": ErrorNumber.DATA_LIMIT,
    }
    for params, number in cases.items():
        status = servo.handle(Instruction.REG_WRITE, params)
        assert status is not None and status.number == number
    assert read(servo, "registered_instruction") == 0


# Indirect registers -------------------------------------------------------------------------


def test_indirect_data_is_the_register_that_its_address_names():
    servo = VirtualServo(1)
    sense(servo, ticks=1234.0)
    for i in range(4):
        assert write(servo, f"indirect_address_{i + 1}", 132 + i) == 0
        assert write(servo, f"indirect_address_{i + 5}", 116 + i) == 0
    assert raw_read(servo, 224, 8) == (0, (1234).to_bytes(4, "little") + b"\0\x08\0\0")
    assert raw_write(servo, 228, (3000).to_bytes(4, "little")) == 0
    assert read(servo, "goal_position") == 3000


def test_indirect_writes_obey_the_rules_of_the_register_behind():
    servo = VirtualServo(1)
    for i in range(4):
        write(servo, f"indirect_address_{i + 1}", 116 + i)
    write(servo, "indirect_address_5", 132)
    write(servo, "indirect_address_6", 65)
    write(servo, "indirect_address_7", 66)
    assert raw_write(servo, 224, (5000).to_bytes(4, "little")) == ErrorNumber.DATA_LIMIT
    assert raw_write(servo, 224, b"\0\0") == ErrorNumber.DATA_LENGTH
    assert raw_write(servo, 228, b"\0") == ErrorNumber.ACCESS  # present position
    assert raw_write(servo, 229, b"\2") == ErrorNumber.DATA_RANGE  # led
    assert raw_write(servo, 230, b"\0") == ErrorNumber.ACCESS  # a gap
    assert write(servo, "indirect_address_1", 63) == ErrorNumber.DATA_RANGE  # EEPROM
    assert write(servo, "indirect_address_1", 662) == ErrorNumber.DATA_RANGE


def test_unmapped_indirect_data_is_memory_of_its_own():
    servo = VirtualServo(1)
    assert raw_write(servo, 224, bytes(range(28))) == 0
    assert raw_read(servo, 224, 28) == (0, bytes(range(28)))
    assert raw_write(servo, 634, b"\x55") == 0
    assert raw_read(servo, 634, 1) == (0, b"\x55")


# Restart, reset, backup ---------------------------------------------------------------------


def test_a_reboot_keeps_eeprom_and_resets_ram():
    servo = VirtualServo(1, quirks=Quirks(reboot_time=0.3))
    write(servo, "pwm_limit", 600)
    write(servo, "indirect_address_1", 68)
    write(servo, "position_p_gain", 111)
    write(servo, "torque_enable", 1)
    status = servo.handle(Instruction.REBOOT)
    assert status is not None and status.error == 0
    assert not servo.listens and not servo.torque_on
    servo.advance(0.29)
    assert not servo.listens
    servo.advance(0.31)
    assert servo.listens
    assert read(servo, "pwm_limit") == read(servo, "goal_pwm") == 600
    assert read(servo, "position_p_gain") == 800
    assert read(servo, "indirect_address_1") == 224
    assert read(servo, "torque_enable") == 0


@pytest.mark.parametrize("kept", Reset)
def test_a_factory_reset_keeps_what_it_is_asked_to(kept: Reset):
    servo = VirtualServo(9, baud=2_000_000)
    write(servo, "return_delay_time", 0)
    status = servo.handle(Instruction.FACTORY_RESET, bytes((kept,)))
    assert status is not None and (status.id, status.error) == (9, 0)
    wake(servo)
    assert read(servo, "return_delay_time") == 250
    assert servo.id == (1 if kept is Reset.ALL else 9)
    assert servo.baud == (2_000_000 if kept is Reset.ALL_BUT_ID_AND_BAUD else 57_600)
    assert read(servo, "firmware_version") == 46


def test_a_factory_reset_refuses_what_it_does_not_know():
    servo = VirtualServo(9)
    for params, number in ((b"\x03", 4), (b"", 5), (b"\x01\x01", 5)):
        status = servo.handle(Instruction.FACTORY_RESET, params)
        assert status is not None and status.number == number
    assert servo.listens


def test_a_backup_brings_back_eeprom_gains_profile_and_indirect_addresses():
    servo = VirtualServo(1)
    kept = {"homing_offset": -77, "position_p_gain": 321, "profile_velocity": 44}
    for name, value in (kept | {"indirect_address_2": 70}).items():
        assert write(servo, name, value) == 0
    status = servo.handle(Instruction.BACKUP, STORE_BACKUP)
    assert status is not None and status.error == 0
    assert read(servo, "backup_ready") == 1
    write(servo, "homing_offset", 5)
    write(servo, "led", 1)
    servo.handle(Instruction.REBOOT)
    wake(servo)
    assert read(servo, "backup_ready") == 1 and read(servo, "position_p_gain") == 800
    status = servo.handle(Instruction.BACKUP, RESTORE_BACKUP)
    assert status is not None and status.error == 0
    wake(servo)
    for name, value in (kept | {"indirect_address_2": 70, "led": 0}).items():
        assert read(servo, name) == value


def test_a_backup_is_refused_under_torque_without_a_copy_and_by_old_firmware():
    servo, old = VirtualServo(1), VirtualServo(2, firmware=44)
    status = servo.handle(Instruction.BACKUP, RESTORE_BACKUP)
    assert status is not None and status.number == ErrorNumber.RESULT_FAIL
    write(servo, "torque_enable", 1)
    status = servo.handle(Instruction.BACKUP, STORE_BACKUP)
    assert status is not None and status.number == ErrorNumber.RESULT_FAIL
    status = old.handle(Instruction.BACKUP, STORE_BACKUP)
    assert status is not None and status.number == ErrorNumber.INSTRUCTION
    assert "backup_ready" not in old.table


def test_startup_configuration_switches_torque_on_and_restores_ram():
    servo = VirtualServo(1)
    write(servo, "startup_configuration", 3)
    write(servo, "position_p_gain", 123)
    servo.handle(Instruction.BACKUP, STORE_BACKUP)
    servo.handle(Instruction.REBOOT)
    assert not servo.motor_command().torque_on
    wake(servo)
    assert servo.motor_command().torque_on and servo.motor_command().p_gain == 123
    assert read(servo, "torque_enable") == 1


def test_power_returns_a_servo_as_a_reboot_does():
    servo = VirtualServo(1, quirks=Quirks(reboot_time=0.2))
    write(servo, "torque_enable", 1)
    write(servo, "led", 1)
    servo.powered = False
    assert not servo.listens and not servo.motor_command().torque_on
    servo.advance(5.0)
    servo.powered = True
    assert not servo.listens
    servo.advance(5.3)
    assert servo.listens
    assert (read(servo, "led"), read(servo, "torque_enable")) == (0, 0)


def test_a_servo_behind_a_broken_cable_continues_with_what_it_does():
    servo = VirtualServo(1)
    write(servo, "torque_enable", 1)
    servo.alive = False
    servo.advance(3.0)
    assert not servo.listens and servo.motor_command().torque_on


# By secondary id and by broadcast -----------------------------------------------------------


def test_by_its_secondary_id_a_servo_obeys_silently_and_leaves_eeprom_alone():
    servo = VirtualServo(1)
    write(servo, "secondary_id", 5)
    assert servo.secondary_id == 5
    assert servo.handle(Instruction.WRITE, b"\x41\0\1", addressing=Addressing.SECONDARY) is None
    assert servo.handle(Instruction.WRITE, b"\x09\0\0", addressing=Addressing.SECONDARY) is None
    assert servo.handle(Instruction.FACTORY_RESET, b"\x01", addressing=Addressing.SECONDARY) is None
    assert servo.handle(Instruction.PING, addressing=Addressing.SECONDARY) is None
    assert (servo.peek("led"), servo.peek("return_delay_time")) == (1, 250)
    write(servo, "secondary_id", 253)
    assert servo.secondary_id is None


# Clock --------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [VirtualServo, partial(PlainServo, model="MX-28(1.0)")])
@given(time=st.floats(0.0, 1e5))
def test_the_realtime_tick_counts_milliseconds_and_wraps(
    make: Callable[[int], VirtualServo | PlainServo], time: float
):
    servo = make(1)
    servo.advance(time)
    assert servo.peek("realtime_tick") == int(time * 1000.0) % 32768


def test_a_mode_change_brings_back_gains_profile_and_goals():
    servo = VirtualServo(1)
    for name in ("position_p_gain", "velocity_i_gain", "profile_velocity", "profile_acceleration"):
        write(servo, name, 7)
    write(servo, "goal_pwm", 10)
    write(servo, "goal_current", -20)
    assert write(servo, "operating_mode", OperatingMode.VELOCITY) == 0
    assert (read(servo, "position_p_gain"), read(servo, "velocity_i_gain")) == (800, 1920)
    assert (read(servo, "profile_velocity"), read(servo, "profile_acceleration")) == (0, 0)
    assert (read(servo, "goal_pwm"), read(servo, "goal_current")) == (885, 1193)


def test_a_model_refuses_modes_that_it_does_not_have():
    for mode in range(17):
        known = mode in table_named("XL430-W250").modes
        error = write(VirtualServo(1, "XL430-W250"), "operating_mode", mode)
        assert error == (0 if known else ErrorNumber.DATA_RANGE)
