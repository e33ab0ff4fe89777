"""The look at the bus before anything moves finds what is wrong, and changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from memory_rig import Rig
from tiny_robots import with_servos, with_types

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import ServoFacts, Severity, check_servo, diagnose
from drivers.dynamixel.protocol2 import Instruction
from drivers.dynamixel.startup import locate
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo
from robots import Joint, Robot
from robots.servo import RAD_PER_TICK

READING = (Instruction.PING, Instruction.READ)
WARNING, ERROR, FAULT = Severity.WARNING, Severity.ERROR, Severity.FAULT


def powered(robot: Robot, firmware: int = 46) -> Rig:
    rig = Rig(robot, firmware=firmware)
    rig.virtual.board.handle(0x03, bytes((24, 0, 1)))
    rig.virtual.physics.advance(1.0)
    rig.port.open()
    return rig


@pytest.fixture
def rig(tiny) -> Rig:
    return powered(tiny)


def look(rig: Rig):
    bus = DynamixelBus(rig.port, sleeps=False)
    return locate(rig.robot, diagnose(bus, rig.robot.joints))


def feel(rig: Rig, ticks: float, voltage: float = 12.0) -> None:
    rig.servo("l_hip").sense(Measured(ticks=ticks, voltage=voltage))


def test_a_sound_bus_has_no_findings_tells_what_is_there_and_is_only_read(rig):
    found = look(rig)
    assert found.findings == ()
    assert [servo.table.model for servo in found.servos] == ["XM430-W350"] * 2
    assert [servo.firmware for servo in found.servos] == [46, 46]
    assert found.servos[0].voltage == pytest.approx(12.0)
    assert found.servos[0].temperature == 25.0
    assert found.servos[1].angle == pytest.approx(rig.true_angles()[1])
    assert rig.port.sent, "the test shows nothing"
    assert all(packet.instruction in READING for packet in rig.port.sent)


@pytest.mark.parametrize(
    ("item", "value", "severity", "words"),
    [
        ("temperature_limit", 40, WARNING, "is 40 °C, expected 80 °C as shipped; getup"),
        ("min_voltage_limit", 110, WARNING, "min voltage limit is 11 V, expected 9.5 V"),
        ("max_voltage_limit", 130, WARNING, "servo write max_voltage_limit=160 --id ID"),
        ("drive_mode", 1, ERROR, "drive mode is 1, reversed"),
        ("hardware_error_status", 36, FAULT, "overheating and overload"),
    ],
)
def test_each_thing_that_is_wrong_is_reported_with_a_remedy(rig, item, value, severity, words):
    rig.servo("l_hip").poke(item, value)
    (finding,) = look(rig).findings
    assert finding.severity is severity
    assert finding.device == "joint 'l_hip' (id 1)"
    assert words in str(finding)
    assert finding.remedy in str(finding)


def kill(rig: Rig, *joints: str) -> None:
    for joint in joints:
        rig.servo(joint).alive = False


def flatten(rig: Rig) -> None:
    for servo in rig.virtual.servos:
        servo.sense(Measured(voltage=9.2))
    rig.virtual.board.sense_voltage(9.2)
    assert all(servo.peek("hardware_error_status") for servo in rig.virtual.servos)


def exchange(rig: Rig) -> None:
    rig.port.chain.devices[0] = VirtualServo(1, "XL430-W250", baud=1_000_000)


def add_twin(rig: Rig) -> None:
    twin = VirtualServo(1, baud=1_000_000)
    twin.poke("firmware_version", 45)
    rig.port.chain.devices.append(twin)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda rig: feel(rig, 2048.0, 14.8), []),  # what a servo bears
        (lambda rig: feel(rig, 2048.0, 14.9), ["supply is 14.9 V, expected 10.0 to 14.8 V"]),
        (lambda rig: feel(rig, 2048.0, 9.6), ["supply is 9.6 V, expected 10.0 to 14.8 V; charge"]),
        (flatten, ["all 2 servos: supply is 9.2 V, expected 10.0 to 14.8 V"]),
        (lambda rig: feel(rig, 3500.0), ["is at +2.23 rad, outside [-1.57, +1.05] rad"]),
        (lambda rig: kill(rig, "r_hip"), ["joint 'r_hip' (id 2): silent; check its cable"]),
        (lambda rig: kill(rig, "l_hip", "r_hip"), ["silent: all 2 servos", "power switch"]),
        (lambda rig: rig.poke("baud_rate", 1), ["use 57600 bit/s, expected 1000000"]),
        (exchange, ["is a XL430-W250, expected XM430-W350"]),
        (add_twin, ["joint 'l_hip' (id 1)", "garbled, as by two servos of one id"]),
    ],
)
def test_what_is_wrong_with_the_supply_or_the_wire_is_said_once(rig, spoil, words):
    spoil(rig)
    found = [str(finding) for finding in look(rig).findings if finding.severity is not FAULT]
    assert len(found) == bool(words)
    assert [word for word in words if word not in found[0]] == []
    assert rig.port.baud == 1_000_000, "the port is left at the wrong speed"


@pytest.mark.parametrize(
    ("limit", "tenths", "severity", "words"),
    [
        ("min_voltage_limit", 115, None, ""),
        ("min_voltage_limit", 116, WARNING, "0.4 V from its voltage limits of 11.6 to"),
        ("min_voltage_limit", 121, ERROR, "expected 12.1 to 14.8 V; charge or change"),
        ("max_voltage_limit", 125, None, ""),
        ("max_voltage_limit", 122, WARNING, "12.0 V, only 0.2 V from its voltage limits"),
        ("max_voltage_limit", 119, ERROR, "expected 10.0 to 11.9 V; charge or change"),
    ],
)
def test_a_supply_at_the_limits_inside_a_servo_is_a_warning_and_beyond_them_an_error(
    rig, limit, tenths, severity, words
):
    """At 12 V, with half a volt for what the supply sags and swings."""
    rig.servo("l_hip").poke(limit, tenths)
    found = look(rig).findings
    assert found[-1].text.startswith(limit.replace("_", " ")), "it differs from the shipped one"
    assert [f.severity for f in found[:-1]] == ([] if severity is None else [severity])
    assert words in str(found[0])


@pytest.mark.parametrize(("beyond", "count"), [(0.09, 0), (0.12, 1)])
def test_a_tenth_of_a_radian_outside_the_range_is_no_finding(rig, beyond: float, count: int):
    feel(rig, float(rig.robot.joints[0].servo.to_ticks(rig.robot.joints[0].upper + beyond)))
    assert [f.severity for f in look(rig).findings] == [WARNING] * count


SOUND = {
    "drive_mode": 0,
    "secondary_id": 255,
    "homing_offset": 0,
    "pwm_limit": 885,
    "current_limit": 1193,
    "startup_configuration": 0,
    "shutdown": 52,
    "hardware_error_status": 0,
    "present_position": 2048,
    "present_input_voltage": 120,
}


def check(
    joint: Joint, firmware: int = 46, model: str = "XM430-W350", **registers: int
) -> list[str]:
    table = table_named(model, firmware)
    facts = ServoFacts(joint=joint, table=table, firmware=firmware, registers=SOUND | registers)
    return [str(finding) for finding in check_servo(facts)]


LIMITS = [
    ({}, None),
    ({"firmware": 38}, None),  # the first with a bus watchdog (e-manual)
    ({"firmware": 37}, "firmware 37 has no bus watchdog, expected 38 or newer"),
    ({"secondary_id": 253}, None),  # from 253 on it is off (e-manual)
    ({"secondary_id": 252}, "also responds to the secondary id 252"),
    ({"present_input_voltage": 148}, None),  # 10.0 to 14.8 V (e-manual)
    ({"present_input_voltage": 100}, None),
    ({"present_input_voltage": 99}, "supply is 9.9 V, expected 10.0 to 14.8 V"),
    ({"current_limit": 856}, None),  # 2.3 A at stall are 855.02 counts of 2.69 mA
    ({"current_limit": 855}, "current limit is 855, 856 is its stall current"),
    ({"pwm_limit": 884}, "PWM limit is 884 of 885: it has less torque"),
    ({"homing_offset": 1}, "homing offset is 1 ticks"),
    ({"shutdown": 36}, None),  # overheating and overload
    ({"shutdown": 32}, "shutdown is 32: overheating or overload would not stop it"),
    ({"startup_configuration": 2}, None),  # restores the backup, without torque
    ({"startup_configuration": 3}, "switches torque on by itself at power-up"),
    ({"drive_mode": 4}, None),  # the setup corrects it
    ({"drive_mode": 5}, "drive mode is 5, reversed: it would turn the wrong way"),
    ({"hardware_error_status": 1}, "reports an error: voltage; restart it"),
    ({"hardware_error_status": 16}, "has switched itself off: electrical shock; restart it"),
    ({"hardware_error_status": 32}, "has switched itself off: overload; let it cool down"),
]


def test_each_limit_is_where_the_manual_puts_it(tiny):
    for registers, words in LIMITS:
        found = check(tiny.joints[0], **registers)
        assert len(found) == (words is not None), registers
        assert words is None or words in found[0]
    found = check(tiny.joints[0], hardware_error_status=32, shutdown=0)
    assert any("reports an error: overload; let it cool down" in text for text in found)


def test_types_with_one_table_are_not_told_what_another_is_shipped_with(tiny):
    """STS3215 for 7.4 V and for 12 V: their limits differ, their registers do not say which."""
    joint = with_types(tiny, "STS3215-C001").joints[0]
    limits = {"max_voltage_limit": 80, "min_voltage_limit": 45, "temperature_limit": 60}
    found = check(joint, 9, "STS3215", **limits, present_input_voltage=74)
    limit = [text for text in found if "limit is" in text and "PWM" not in text]
    assert len(limit) == 1 and "temperature limit is 60 °C, expected 70 °C as shipped" in limit[0]
    moved = replace(joint, servo=replace(joint.servo, zero_ticks=100))  # it counts no turns
    found = check(moved, 9, "STS3215", present_position=100)
    assert any("its range needs ticks -" in line and "expected 0 to 4095" in line for line in found)


def test_a_range_that_crosses_the_end_of_the_servos_turn_is_no_finding(tiny):
    """The driver counts the turns."""
    left, right = tiny.joints
    rig = powered(with_servos(tiny, {"zero_ticks": 100}, {}))
    feel(rig, 3800.0)
    found = look(rig)
    assert found.findings == ()
    assert found.servos[0].angle == pytest.approx((3800 - 4096 - 100) * RAD_PER_TICK)
    rig = powered(replace(tiny, joints=(replace(left, lower=-np.pi, upper=np.pi), right)))
    for ticks, warnings in ((4000.0, 0), (4090.0, 1)):  # which may be at both ends
        feel(rig, ticks)
        found = [str(finding) for finding in look(rig).findings]
        assert ["may be at -3.15: turns apart" in text for text in found] == [True] * warnings
