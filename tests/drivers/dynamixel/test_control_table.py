"""The control tables: laws that all keep, figures of each, and ROBOTIS' own lists of addresses."""

import math
from importlib.resources import files
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty

from drivers.dynamixel.control_table import (
    Item,
    OperatingMode,
    UnknownModelError,
    known_models,
    table_for,
    table_named,
)
from drivers.state import HardwareError
from robots.bus_settings import BAUD_RATES

SERVOS = [name for name in known_models() if table_named(name).has_watchdog]
"""Servos of the X series and MX(2.0), whose tables are alike."""
EEPROM_ENDS = {"1.0": 24, "2.0": 64, "feetech": 40, "OpenCR": 24, "XL-320": 24}
TABLES = [table_named(name, firmware) for name in known_models() for firmware in (None, 38, 46, 52)]
XM430 = table_named("XM430-W350")
items = st.sampled_from([item for table in TABLES for item in table])


def test_items_lie_in_order_apart_and_are_found_by_their_addresses():
    for table in nonempty(TABLES):
        assert list(table) == sorted(table, key=lambda item: item.address), table.model
        assert all(a.end <= b.address for a, b in pairwise(table)), table.model
        boundary = EEPROM_ENDS.get(table.model, EEPROM_ENDS[table.wire.name])
        for item in nonempty(table):
            assert item.size in (1, 2, 4), (table.model, item.name)
            assert item.eeprom == (item.address < boundary), (table.model, item.name)
        covering = {address: item for item in table for address in range(item.address, item.end)}
        for address in range(-1, table.size + 2):
            assert table.at(address) == covering.get(address), table.model
        assert table.at(table.size - 1) is not None


def test_defaults_and_ranges_fit_their_registers_and_are_those_of_a_new_servo():
    for table in nonempty(TABLES):
        registers = table.initial_bytes()
        assert len(registers) == table.size
        for item in nonempty(table):
            where = (table.model, item.name)
            assert item.writable == (item.lower is not None) == (item.upper is not None), where
            if item.lower is not None and item.upper is not None:
                assert item.decode(item.encode(item.lower)) == item.lower < item.upper, where
                assert item.decode(item.encode(item.upper)) == item.upper, where
            if item.default is not None:
                assert not item.writable or item.accepts(item.default), where
            value = item.decode(bytes(registers[item.address : item.end]))
            assert value == (item.default or 0), where
        assert table["model_number"].default == table.number


@given(item=items, data=st.data())
def test_values_survive_the_trip_through_registers(item: Item, data: st.DataObject):
    bits = 8 * item.size
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if item.signed else (0, 2**bits - 1)
    if item.sign_bit is not None:
        low, high = 1 - (1 << item.sign_bit), (1 << item.sign_bit) - 1
    value = data.draw(st.integers(low, high))
    encoded = item.encode(value)
    assert len(encoded) == item.size
    assert item.decode(encoded) == value
    for outside in (high + 1,) if item.sign_bit is not None else (low - 1, high + 1):
        with pytest.raises(OverflowError):
            item.encode(outside)


def test_negative_values_are_two_s_complement_low_byte_first():
    assert XM430["present_current"].encode(-2) == b"\xfe\xff"
    assert XM430["goal_position"].decode(b"\xff\xff\xff\xff") == -1
    assert XM430["bus_watchdog"].decode(b"\xff") == -1
    with pytest.raises(ValueError, match="present_position has 4 bytes, not 3"):
        XM430["present_position"].decode(bytes(3))


def test_a_number_and_a_name_find_the_same_table_and_an_unknown_model_the_known_ones():
    for name, number in nonempty(known_models().items()):
        wire = table_named(name).wire
        assert table_for(number, None, wire) == table_named(name)
        assert table_for(number, 46, wire) == table_named(name, 46)
    with pytest.raises(UnknownModelError, match=r"model 7: .*XM430-W350 \(1020\).*OpenCR"):
        table_for(7)
    with pytest.raises(UnknownModelError, match="model AX-12"):
        table_named("AX-12")


LISTS = files("dynamixel_easy_sdk").joinpath("control_table")
OTHERS = {  # numbers of models that are not in them: e-manual, feetech-servo-sdk
    "OpenCR": 0x7400,
    "AX-12A": 12,
    "AX-18A": 18,
    "MX-28(1.0)": 29,
    "MX-64(1.0)": 310,
    "MX-106(1.0)": 320,
    "XL-320": 350,
    "STS3215": 777,
    "STS3250": 2825,
}


def list_of(model: str) -> str:
    return model.removesuffix("(2.0)").lower().replace("-", "_") + ".model"


def read_list(name: str) -> list[list[str]]:
    text = LISTS.joinpath(name).read_text("utf-8").split("[control table]")[-1]
    return [line.split("\t") for line in text.strip().splitlines()[1:] if line]


def test_model_numbers_are_those_of_the_makers():
    theirs = {name: int(number) for number, name in read_list("dynamixel.model")}
    ours = known_models()
    assert {name: ours[name] for name in OTHERS} == OTHERS
    for name in nonempty(SERVOS):
        assert ours[name] == theirs[list_of(name)], name


def test_addresses_are_those_of_robotis_own_lists():
    for model in nonempty(SERVOS):
        check_addresses(model, list_of(model), 51 if "330-" in model else None)
        if "330-" in model:
            check_addresses(model, list_of(model).replace(".", "_fw52."), 52)


def check_addresses(model: str, name: str, firmware: int | None) -> None:
    table, theirs = table_named(model, firmware), {}
    for address, size, title in (row[:3] for row in read_list(name)):
        item = title.strip().lower().replace(" ", "_").replace("(shadow)", "")
        if not item.startswith("indirect"):
            theirs[item] = (int(address), int(size))
            continue
        found = table.at(int(address))  # the first of a block
        assert found is not None and (found.address, found.size) == (int(address), int(size))
        assert found.name.startswith("_".join(item.split("_")[:2])), name
    ours = {item.name: (item.address, item.size) for item in table if "indirect" not in item.name}
    newer = {"startup_configuration", "backup_ready"}
    assert ours.keys() - newer == theirs.keys() - newer, name
    assert theirs == {item: ours[item] for item in theirs}, name


def test_a_servo_tells_either_current_or_load_and_its_goals_reach_as_far_as_its_limits():
    for model in nonempty(SERVOS):
        table = table_named(model)
        has_current = OperatingMode.CURRENT in table.modes
        assert ("present_current" in table) == has_current == ("goal_current" in table), model
        assert ("present_load" in table) != has_current
        found = table.at(126)
        expected = "present_current" if has_current else "present_load"
        assert found is not None and found.name == expected
        for quantity in ("pwm", "current", "velocity"):
            if (goal := f"goal_{quantity}") in table:
                upper = table[goal].upper
                assert upper == table[f"{quantity}_limit"].upper == -(table[goal].lower or 0), model
        fastest = table["baud_rate"].upper
        assert fastest is not None
        assert BAUD_RATES[fastest] == (4_000_000 if "330-" in model else 4_500_000)
        assert table.default_mode in table.modes


def test_figures_are_those_of_the_manual():
    defaults = {
        "XM430-W350": {"current_limit": 1193, "velocity_limit": 200, "shutdown": 52},
        "XM540-W270": {"current_limit": 2047, "velocity_limit": 128},
        "XL430-W250": {"position_d_gain": 4000, "temperature_limit": 72},
        "2XC430-W250": {"position_p_gain": 700, "min_voltage_limit": 60},
        "XC330-M288": {"current_limit": 2352, "max_voltage_limit": 70, "pwm_slope": 140},
        "XC330-T288": {"velocity_i_gain": 1200, "current_limit": 910},
        "MX-64(2.0)": {"current_limit": 1941},
        "MX-106(2.0)": {"position_p_gain": 850},
        "OpenCR": {"baud_rate": 4, "dynamixel_power": 0},
    }
    for model, figures in nonempty(defaults.items()):
        table = table_named(model)
        assert {name: table[name].default for name in figures} == figures, model
    for model, name, per_count, unit in (
        ("XM430-W350", "present_position", math.tau / 4096, "rad"),
        ("XM430-W350", "present_velocity", 0.229 * math.tau / 60, "rad/s"),
        ("XM430-W350", "profile_acceleration", 214.577 * math.tau / 3600, "rad/s²"),
        ("XM430-W350", "goal_pwm", 1 / 885, "share"),
        ("XM430-W350", "present_current", 2.69e-3, "A"),
        ("XM430-W350", "return_delay_time", 2e-6, "s"),
        ("XM430-W350", "position_p_gain", 1 / 128, ""),
        ("XM430-W350", "position_i_gain", 1 / 65536, ""),
        ("XC330-M288", "pwm_slope", 1.977, "V/s"),
        ("XC330-T288", "pwm_slope", 3.955, "V/s"),
        ("MX-64(2.0)", "goal_current", 3.36e-3, "A"),
        ("XL430-W250", "present_load", 1e-3, "share"),
        ("OpenCR", "gyro_x", math.radians(1) / 16.4, "rad/s"),
        ("OpenCR", "acc_z", 9.80665 / 16384, "m/s²"),
    ):
        item = table_named(model)[name]
        assert (item.unit, item.scale) == (unit, pytest.approx(per_count, rel=1e-9)), name


def test_modes_and_errors_have_the_manual_s_numbers():
    assert XM430.modes == (0, 1, 3, 4, 5, 16)
    assert table_named("XL430-W250").modes == (1, 3, 4, 16)
    assert table_named("OpenCR").modes == ()
    assert all(OperatingMode(mode) for mode in XM430.modes if mode)
    bit = HardwareError
    bits = {  # lowest first: e-manual; Feetech's memory tables
        "XM430-W350": [1 << place for place in range(6)],
        "XL-320": [bit.OVERLOAD, bit.OVERHEATING, bit.VOLTAGE],
        "STS3215": [bit.VOLTAGE, bit.ENCODER, bit.OVERHEATING, bit.SHOCK, 0, bit.OVERLOAD],
    }
    for model, expected in bits.items():
        named = [table_named(model).name_errors(1 << place) for place in range(len(expected))]
        assert named == expected, model
    assert BAUD_RATES[1] == 57_600


def test_old_firmware_lacks_what_newer_ones_brought():
    for model, since in (("XM430-W350", 45), ("XC330-M288", 46)):
        before, table = table_named(model, since - 1), table_named(model, since)
        for name in ("startup_configuration", "backup_ready"):
            assert name not in before and name in table and name in table_named(model)
        assert not before.supports_fast_read(since - 1) and table.supports_fast_read(since)
    for model in ("2XC430-W250", "MX-64(2.0)", "MX-106(2.0)", "OpenCR"):
        assert not table_named(model).supports_fast_read(99)


def test_each_indirect_byte_points_at_itself_until_it_is_mapped():
    for table in nonempty(table for table in TABLES if table.model in SERVOS):
        count = sum(item.name.startswith("indirect_data_") for item in table)
        assert count == (20 if "330-" in table.model else 56)
        for n in range(1, count + 1):
            address, data = table[f"indirect_address_{n}"], table[f"indirect_data_{n}"]
            assert (address.size, data.size) == (2, 1)
            assert address.default == data.address
            assert (address.lower, address.upper) == (64, table.size - 1)
