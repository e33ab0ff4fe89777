"""The control tables: laws that all keep, figures of each, and ROBOTIS' own lists of addresses."""

import math
from importlib.resources import files
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty

from drivers.dynamixel.control_table import (
    ControlTable,
    Item,
    OperatingMode,
    UnknownModelError,
    known_models,
    table_for,
    table_named,
)
from drivers.dynamixel.protocol2 import Span
from drivers.errors import DriverError
from drivers.state import HardwareError
from robots.bus_settings import BAUD_RATES

SERVOS = [name for name in known_models() if table_named(name).has_watchdog]
"""Servos of the X series and MX(2.0), whose tables are alike."""
EEPROM_ENDS = {"1.0": 24, "2.0": 64, "feetech": 40}
PLAIN = 24  # of the XL-320 and the board
TABLES = [table_named(name, firmware) for name in known_models() for firmware in (None, 38, 46, 52)]
XM430 = table_named("XM430-W350")
all_tables = pytest.mark.parametrize("table", TABLES, ids=lambda table: table.model)
items = st.sampled_from([item for table in TABLES for item in table])


# Laws ---------------------------------------------------------------------------------------


@all_tables
def test_no_register_belongs_to_two_items(table: ControlTable):
    ordered = sorted(table, key=lambda item: item.address)
    assert list(table) == ordered
    assert all(a.end <= b.address for a, b in pairwise(ordered))
    assert all(item.size in (1, 2, 4) for item in table)


@all_tables
def test_each_address_leads_to_the_item_that_covers_it(table: ControlTable):
    for address in range(-1, table.size + 2):
        covering = [item for item in table if item.address <= address < item.end]
        assert table.at(address) == (covering[0] if covering else None)
    assert table.at(table.size - 1) is not None


@all_tables
def test_defaults_may_be_written_and_fit_their_registers(table: ControlTable):
    defaults = [item for item in table if item.default is not None]
    assert defaults
    for item in defaults:
        assert item.default is not None
        assert not item.writable or item.accepts(item.default), item.name
        assert item.decode(item.encode(item.default)) == item.default


@all_tables
def test_writable_items_and_only_they_have_a_range_that_fits(table: ControlTable):
    for item in nonempty(table):
        assert item.writable == (item.lower is not None) == (item.upper is not None), item.name
        if item.lower is not None and item.upper is not None:
            assert item.decode(item.encode(item.lower)) == item.lower < item.upper
            assert item.decode(item.encode(item.upper)) == item.upper


@all_tables
def test_the_eeprom_lies_before_the_ram(table: ControlTable):
    is_plain = table.model in ("OpenCR", "XL-320")
    boundary = PLAIN if is_plain else EEPROM_ENDS[table.wire.name]
    assert all(item.eeprom == (item.address < boundary) for item in nonempty(table))


@all_tables
def test_factory_registers_hold_the_defaults(table: ControlTable):
    registers = table.initial_bytes()
    assert len(registers) == table.size
    for item in table:
        value = item.decode(bytes(registers[item.address : item.end]))
        assert value == (item.default or 0)
    assert table["model_number"].default == table.number


@given(item=items, data=st.data())
def test_values_survive_the_trip_through_registers(item: Item, data: st.DataObject):
    bits = 8 * item.size
    if item.sign_bit is not None:
        value = data.draw(st.integers(1 - (1 << item.sign_bit), (1 << item.sign_bit) - 1))
        assert item.decode(item.encode(value)) == value
        with pytest.raises(OverflowError):
            item.encode(1 << item.sign_bit)
        return
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if item.signed else (0, 2**bits - 1)
    value = data.draw(st.integers(low, high))
    encoded = item.encode(value)
    assert len(encoded) == item.size
    assert item.decode(encoded) == value
    for outside in (low - 1, high + 1):
        with pytest.raises(OverflowError):
            item.encode(outside)


@given(item=items, data=st.data())
def test_registers_survive_the_trip_through_values(item: Item, data: st.DataObject):
    encoded = data.draw(st.binary(min_size=item.size, max_size=item.size))
    value = item.decode(encoded)
    assert item.decode(item.encode(value)) == value
    assert item.sign_bit is not None or item.encode(value) == encoded


def test_registers_of_another_size_are_refused():
    with pytest.raises(ValueError, match="present_position has 4 bytes, not 3"):
        XM430["present_position"].decode(bytes(3))


def test_negative_values_are_two_s_complement_low_byte_first():
    assert XM430["present_current"].encode(-2) == b"\xfe\xff"
    assert XM430["goal_position"].decode(b"\xff\xff\xff\xff") == -1
    assert XM430["bus_watchdog"].decode(b"\xff") == -1


# Finding ------------------------------------------------------------------------------------


def test_a_number_and_a_name_find_the_same_table():
    for name, number in nonempty(known_models().items()):
        wire = table_named(name).wire
        assert table_for(number, None, wire) == table_named(name)
        assert table_for(number, 46, wire) == table_named(name, 46)


def test_an_unknown_model_is_answered_with_the_known_ones():
    with pytest.raises(
        UnknownModelError, match=r"model 7: .*XM430-W350 \(1020\).*OpenCR"
    ) as caught:
        table_for(7)
    assert isinstance(caught.value, DriverError)
    assert caught.value.model == 7
    with pytest.raises(UnknownModelError, match="model AX-12"):
        table_named("AX-12")


def test_model_numbers_are_those_of_the_makers():
    assert known_models() == {
        "XM430-W350": 1020,
        "XM430-W210": 1030,
        "XH430-W350": 1000,
        "XH430-W210": 1010,
        "XH430-V350": 1040,
        "XM540-W270": 1120,
        "XM540-W150": 1130,
        "XH540-W270": 1100,
        "XH540-W150": 1110,
        "XH540-V270": 1140,
        "XW540-T260": 1170,
        "XL430-W250": 1060,
        "XC430-W240": 1080,
        "XC430-W150": 1070,
        "2XC430-W250": 1160,
        "2XL430-W250": 1090,
        "XC330-M288": 1240,
        "XC330-T288": 1220,
        "XC330-M181": 1230,
        "XC330-T181": 1210,
        "XL330-M288": 1200,
        "XL330-M077": 1190,
        "MX-28(2.0)": 30,
        "MX-64(2.0)": 311,
        "MX-106(2.0)": 321,
        "OpenCR": 0x7400,
        "AX-12A": 12,
        "AX-18A": 18,
        "MX-28(1.0)": 29,
        "MX-64(1.0)": 310,
        "MX-106(1.0)": 320,
        "XL-320": 350,
        "STS3215": 777,
        "STS3250": 2825,
        "SCS0009": 1284,
    }


# Addresses ----------------------------------------------------------------------------------

SDK_NAMES = {"secondary(shadow)_id": "secondary_id"}
SDK_FILES = {
    "xm430_w350": ("XM430-W350", None),
    "xm430_w210": ("XM430-W210", None),
    "xh430_w350": ("XH430-W350", None),
    "xh430_w210": ("XH430-W210", None),
    "xh430_v350": ("XH430-V350", None),
    "xm540_w270": ("XM540-W270", None),
    "xm540_w150": ("XM540-W150", None),
    "xh540_w270": ("XH540-W270", None),
    "xh540_w150": ("XH540-W150", None),
    "xh540_v270": ("XH540-V270", None),
    "xw540_t260": ("XW540-T260", None),
    "xc430_w240": ("XC430-W240", None),
    "xc430_w150": ("XC430-W150", None),
    "2xl430_w250": ("2XL430-W250", None),
    "xl430_w250": ("XL430-W250", None),
    "2xc430_w250": ("2XC430-W250", None),
    "xc330_m288": ("XC330-M288", 51),
    "xc330_m288_fw52": ("XC330-M288", 52),
    "xc330_t288": ("XC330-T288", 51),
    "xc330_t288_fw52": ("XC330-T288", 52),
    "xc330_m181": ("XC330-M181", 51),
    "xc330_m181_fw52": ("XC330-M181", 52),
    "xc330_t181": ("XC330-T181", 51),
    "xc330_t181_fw52": ("XC330-T181", 52),
    "xl330_m288": ("XL330-M288", 51),
    "xl330_m288_fw52": ("XL330-M288", 52),
    "xl330_m077": ("XL330-M077", 51),
    "xl330_m077_fw52": ("XL330-M077", 52),
    "mx_28": ("MX-28(2.0)", None),
    "mx_64": ("MX-64(2.0)", None),
    "mx_106": ("MX-106(2.0)", None),
}


@pytest.mark.parametrize("file", SDK_FILES)
def test_addresses_are_those_of_robotis_own_lists(file: str):
    table = table_named(*SDK_FILES[file])
    text = files("dynamixel_easy_sdk").joinpath("control_table", f"{file}.model").read_text("utf-8")
    rows = [line.split("\t") for line in text.split("[control table]")[1].split("\n")[2:] if line]
    theirs = {}
    for address, size, title in (row[:3] for row in rows):
        name = title.strip().lower().replace(" ", "_")
        if not name.startswith("indirect"):
            theirs[SDK_NAMES.get(name, name)] = (int(address), int(size))
            continue
        found = table.at(int(address))  # the first of a block
        assert found is not None and (found.address, found.size) == (int(address), int(size))
        assert found.name.startswith("_".join(name.split("_")[:2]))
    ours = {item.name: (item.address, item.size) for item in table}
    newer = {"startup_configuration", "backup_ready"}
    assert theirs.keys() <= ours.keys()
    assert {name for name in ours if "indirect" not in name} - newer == theirs.keys() - newer
    assert theirs == {name: ours[name] for name in theirs}


def test_the_feedback_of_a_cycle_lies_side_by_side():
    assert XM430.span("present_current", "present_position") == Span(126, 10)
    assert XM430.span("present_input_voltage", "present_temperature") == Span(144, 3)
    assert XM430["goal_position"].span == Span(116, 4)


@pytest.mark.parametrize("model", SERVOS)
def test_a_servo_tells_either_current_or_load(model: str):
    table = table_named(model)
    has_current = OperatingMode.CURRENT in table.modes
    assert ("present_current" in table) == has_current == ("goal_current" in table)
    assert ("present_load" in table) != has_current
    found = table.at(126)
    assert found is not None and found.name == (
        "present_current" if has_current else "present_load"
    )


# Figures ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "name", "value"),
    [
        ("XM430-W350", "current_limit", 1193),
        ("XM430-W350", "velocity_limit", 200),
        ("XM430-W350", "position_p_gain", 800),
        ("XM430-W350", "return_delay_time", 250),
        ("XM430-W350", "shutdown", 52),
        ("XM540-W270", "current_limit", 2047),
        ("XM540-W270", "velocity_limit", 128),
        ("XL430-W250", "position_d_gain", 4000),
        ("XL430-W250", "temperature_limit", 72),
        ("XL430-W250", "max_voltage_limit", 140),
        ("2XC430-W250", "position_p_gain", 700),
        ("2XC430-W250", "min_voltage_limit", 60),
        ("XC330-M288", "current_limit", 2352),
        ("XC330-M288", "max_voltage_limit", 70),
        ("XC330-M288", "pwm_slope", 140),
        ("XC330-T288", "velocity_i_gain", 1200),
        ("XC330-T288", "current_limit", 910),
        ("MX-64(2.0)", "current_limit", 1941),
        ("MX-106(2.0)", "position_p_gain", 850),
        ("OpenCR", "baud_rate", 4),
        ("OpenCR", "dynamixel_power", 0),
    ],
)
def test_defaults_are_those_of_the_manual(model: str, name: str, value: int):
    assert table_named(model)[name].default == value


@pytest.mark.parametrize(
    ("model", "name", "per_count", "unit"),
    [
        ("XM430-W350", "present_position", math.tau / 4096, "rad"),
        ("XM430-W350", "present_velocity", 0.229 * math.tau / 60, "rad/s"),
        ("XM430-W350", "profile_acceleration", 214.577 * math.tau / 3600, "rad/s²"),
        ("XM430-W350", "goal_pwm", 1 / 885, "share"),
        ("XM430-W350", "present_current", 2.69e-3, "A"),
        ("XM430-W350", "return_delay_time", 2e-6, "s"),
        ("XM430-W350", "position_p_gain", 1 / 128, ""),
        ("XM430-W350", "position_i_gain", 1 / 65536, ""),
        ("XC330-M288", "present_current", 1e-3, "A"),
        ("XC330-M288", "pwm_slope", 1.977, "V/s"),
        ("XC330-T288", "pwm_slope", 3.955, "V/s"),
        ("MX-64(2.0)", "goal_current", 3.36e-3, "A"),
        ("XL430-W250", "present_load", 1e-3, "share"),
        ("OpenCR", "gyro_x", math.radians(1) / 16.4, "rad/s"),
        ("OpenCR", "acc_z", 9.80665 / 16384, "m/s²"),
        ("OpenCR", "present_input_voltage", 0.1, "V"),
    ],
)
def test_a_count_is_worth_what_the_manual_says(model: str, name: str, per_count: float, unit: str):
    item = table_named(model)[name]
    assert item.unit == unit
    assert item.scale == pytest.approx(per_count, rel=1e-9)


@pytest.mark.parametrize("model", SERVOS)
def test_goals_reach_as_far_as_the_widest_limit_and_no_further(model: str):
    table = table_named(model)
    for goal, limit in (
        ("goal_pwm", "pwm_limit"),
        ("goal_current", "current_limit"),
        ("goal_velocity", "velocity_limit"),
    ):
        if goal in table:
            assert table[goal].upper == table[limit].upper == -(table[goal].lower or 0)
    fastest = table["baud_rate"].upper
    assert fastest is not None
    assert BAUD_RATES[fastest] == (4_000_000 if "330-" in model else 4_500_000)


FEETECH_BITS = (
    HardwareError.VOLTAGE,
    HardwareError.ENCODER,
    HardwareError.OVERHEATING,
    HardwareError.SHOCK,  # current
    0,
    HardwareError.OVERLOAD,
)
ERROR_BITS = {  # lowest first: e-manual; Feetech's memory tables
    "XM430-W350": tuple(1 << place for place in range(6)),
    "XL-320": (HardwareError.OVERLOAD, HardwareError.OVERHEATING, HardwareError.VOLTAGE),
    "STS3215": FEETECH_BITS,
    "SCS0009": FEETECH_BITS,
}


def test_modes_and_errors_have_the_manual_s_numbers():
    assert XM430.modes == (0, 1, 3, 4, 5, 16)
    assert table_named("XL430-W250").modes == (1, 3, 4, 16)
    assert table_named("OpenCR").modes == ()
    assert all(OperatingMode(mode) for mode in XM430.modes if mode)
    assert all(table_named(model).default_mode in table_named(model).modes for model in SERVOS)
    stops = HardwareError.OVERHEATING | HardwareError.SHOCK | HardwareError.OVERLOAD
    assert XM430["shutdown"].default == stops
    for model, bits in ERROR_BITS.items():
        named = [table_named(model).name_errors(1 << place) for place in range(len(bits))]
        assert named == list(bits), model
    assert BAUD_RATES[1] == 57_600


# Firmware -----------------------------------------------------------------------------------


def test_old_firmware_lacks_what_newer_ones_brought():
    for model, since in (("XM430-W350", 45), ("XC330-M288", 46)):
        for name in ("startup_configuration", "backup_ready"):
            assert name not in table_named(model, since - 1)
            assert name in table_named(model, since)
            assert name in table_named(model)


def test_fast_reads_need_a_firmware_that_has_them():
    assert [XM430.supports_fast_read(f) for f in (44, 45, 60)] == [False, True, True]
    xc330 = table_named("XC330-T288")
    assert [xc330.supports_fast_read(f) for f in (45, 46)] == [False, True]
    for model in ("2XC430-W250", "MX-64(2.0)", "MX-106(2.0)", "OpenCR"):
        assert not table_named(model).supports_fast_read(99)


def test_backups_need_a_firmware_that_has_them():
    assert [XM430.supports_backup(f) for f in (44, 45)] == [False, True]
    assert not table_named("OpenCR").supports_backup(99)


@pytest.mark.parametrize("firmware", [None, 46, 51, 52])
@pytest.mark.parametrize("model", SERVOS)
def test_each_indirect_byte_points_at_itself_until_it_is_mapped(model: str, firmware: int | None):
    table = table_named(model, firmware)
    count = sum(block.count for block in table.indirect)
    assert count == (20 if "330-" in model else 56)
    for n in range(1, count + 1):
        address, data = table[f"indirect_address_{n}"], table[f"indirect_data_{n}"]
        assert (address.size, data.size) == (2, 1)
        assert address.default == data.address
        assert (address.lower, address.upper) == (64, table.size - 1)


def test_indirect_items_moved_with_a_firmware_of_the_xc330():
    assert table_named("XC330-M288", 51)["indirect_data_1"].address == 224
    assert table_named("XC330-M288", 52)["indirect_data_1"].address == 208
    assert table_named("XC330-M288")["indirect_data_20"].address == 227
    assert XM430["indirect_address_29"].address == 578
    assert XM430["indirect_data_56"].address == 661
