"""A control table in memory: what a read or write of some addresses touches."""

import pytest

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.protocol2 import ErrorNumber
from drivers.virtual_bus.devices.quirks import UndefinedRegisters
from drivers.virtual_bus.devices.registers import Registers, clamp

TABLE = table_named("XM430-W350", 46)


@pytest.fixture
def registers() -> Registers:
    return Registers(TABLE)


def test_values_are_little_endian_at_their_addresses(registers: Registers):
    registers["goal_position"] = -2
    registers["goal_current"] = 0x0102
    assert registers.memory[116:120] == b"\xfe\xff\xff\xff"
    assert registers.memory[102:104] == b"\x02\x01"
    assert registers["goal_position"] == -2
    assert registers.value_or_zero("no such item") == 0 and "no such item" not in registers


def test_a_read_may_cross_a_gap_and_not_begin_in_one(registers: Registers):
    assert registers.read(64, 4) == (0, b"\x00\x00\x00\x00")  # torque, LED, and a gap of two
    assert registers.read(66, 2) == (ErrorNumber.ACCESS, b"")
    assert registers.read(TABLE.size - 1, 2) == (ErrorNumber.ACCESS, b"")
    assert registers.read(64, 0) == (ErrorNumber.DATA_LENGTH, b"")
    strict = Registers(TABLE, UndefinedRegisters.ACCESS_ERROR)
    assert strict.read(64, 4) == (ErrorNumber.ACCESS, b"")
    assert strict.read(64, 2) == (0, b"\x00\x00")


def test_a_write_sets_whole_items(registers: Registers):
    plan = registers.plan_write(100, 8)
    assert plan.error == 0
    assert [(field.name, field.offset) for field in plan.fields] == [
        ("goal_pwm", 0),
        ("goal_current", 2),
        ("goal_velocity", 4),
    ]
    assert registers.plan_write(100, 6).error == ErrorNumber.DATA_LENGTH, "half a velocity"
    assert registers.plan_write(100, 1).error == ErrorNumber.DATA_LENGTH, "half a share"
    assert registers.plan_write(0, 2).error == ErrorNumber.ACCESS, "the model number"
    assert registers.plan_write(64, 0).error == ErrorNumber.DATA_LENGTH


def test_a_write_to_eeprom_is_known_as_one(registers: Registers):
    assert registers.plan_write(7, 1).eeprom
    assert not registers.plan_write(64, 1).eeprom
    assert not registers.plan_write(64, 2).remaps
    assert registers.plan_write(168, 2).remaps


def test_indirect_data_is_the_register_that_it_points_to(registers: Registers):
    for number, address in enumerate(range(132, 136), start=1):
        registers[f"indirect_address_{number}"] = address
    registers["present_position"] = 0x01020304
    assert registers.read(224, 4) == (0, b"\x04\x03\x02\x01")
    assert registers.plan_write(224, 4).error == ErrorNumber.ACCESS, "a measured value"
    registers["indirect_address_1"] = 65
    (field,) = registers.plan_write(224, 1).fields
    assert (field.name, field.address) == ("led", 65)


@pytest.mark.parametrize(("value", "kept"), [(7, 7), (11, 10), (-11, -10), (-10, -10)])
def test_values_are_clamped_on_both_sides(value: int, kept: int):
    assert clamp(value, 10) == kept
