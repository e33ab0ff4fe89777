"""A virtual servo's protection: hardware errors, shutdown, bus watchdog."""

import pytest
from wire_talk import powered, read, sense, write

from drivers.dynamixel.protocol2 import ALERT, ErrorNumber, Instruction
from drivers.state import HardwareError
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.servo import VirtualServo
from robots.description.servo_catalog import servo_models

STALL = servo_models()["XM430-W350"].stall_current
ALL_ERRORS = [HardwareError(1 << bit) for bit in (0, 2, 3, 4, 5)]


@pytest.mark.parametrize("error", ALL_ERRORS)
def test_after_a_shutdown_only_a_reboot_brings_torque_back(error: HardwareError):
    servo = powered(shutdown=int(error))
    sense(servo, ticks=1500.0)
    servo.trip(error)
    assert write(servo, "torque_enable", 1) == ALERT
    assert read(servo, "torque_enable") == 0 and not servo.torque_on
    assert write(servo, "shutdown", 0) == ALERT  # too late
    assert write(servo, "torque_enable", 1) == ALERT
    assert not servo.torque_on
    status = servo.handle(Instruction.REBOOT)
    assert status is not None and status.error == ALERT
    servo.advance(1.0)
    assert read(servo, "hardware_error_status") == 0
    assert write(servo, "torque_enable", 1) == 0
    assert servo.motor_command().torque_on and servo.motor_command().target_ticks == 1500.0


def test_heat_trips_above_the_limit_and_again_after_a_reboot_while_hot():
    servo = powered()
    sense(servo, temperature=80.0)
    assert servo.torque_on
    sense(servo, temperature=80.6)
    assert not servo.torque_on
    assert read(servo, "hardware_error_status") == HardwareError.OVERHEATING
    sense(servo, temperature=30.0)
    assert read(servo, "hardware_error_status") == HardwareError.OVERHEATING
    servo.reboot()
    servo.advance(1.0)
    sense(servo, temperature=90.0)
    assert read(servo, "hardware_error_status") == HardwareError.OVERHEATING


def time_to_trip(current: float, longest: float = 60.0) -> float:
    """Seconds of a steady current until overload, ``inf`` for never."""
    servo = VirtualServo(1)
    write(servo, "torque_enable", 1)
    sense(servo, current=current)
    step = 0.01
    for i in range(1, round(longest / step)):
        servo.advance(i * step)
        if servo.peek("hardware_error_status") & HardwareError.OVERLOAD:
            assert not servo.torque_on
            return i * step
    return float("inf")


def test_the_larger_the_load_the_sooner_it_trips_and_a_bearable_one_never_does():
    # 3 s * -ln(1 - 0.8²) = 3.065 s at stall, either way round
    assert time_to_trip(STALL) == pytest.approx(3.07, abs=0.011)
    assert time_to_trip(-STALL) == pytest.approx(3.07, abs=0.011)
    times = [time_to_trip(share * STALL) for share in (1.5, 1.0, 0.82)]
    assert times == sorted(times) and times[-1] < 20.0
    assert time_to_trip(0.79 * STALL) == float("inf")


def test_silence_trips_the_watchdog_and_motion_stops_where_it_is():
    servo = powered(profile_velocity=50, profile_acceleration=5)
    write(servo, "bus_watchdog", 5)  # 100 ms
    write(servo, "goal_position", 3500)
    servo.advance(0.1)
    sense(servo, ticks=2100.0, velocity=0.5)
    assert servo.peek("bus_watchdog") == 5 and servo.has_profile
    servo.advance(0.101)
    assert read(servo, "bus_watchdog") == -1
    assert not servo.has_profile and servo.torque_on
    assert servo.motor_command().target_ticks == read(servo, "goal_position") == 2100
    assert read(servo, "profile_velocity") == read(servo, "profile_acceleration") == 0
    for name in ("goal_pwm", "goal_current", "goal_velocity", "goal_position"):
        assert write(servo, name, 0) == ErrorNumber.DATA_RANGE, "not until it is cleared"
    assert write(servo, "bus_watchdog", 5) == ErrorNumber.DATA_RANGE
    assert servo.motor_command().target_ticks == 2100.0
    assert write(servo, "bus_watchdog", 0) == write(servo, "goal_position", 2200) == 0
    assert read(servo, "goal_position") == 2200


def test_what_a_feetech_keeps_without_power_is_behind_its_lock():
    servo = PlainServo(1, "STS3215-C018")
    for locked, kept in ((1, 70), (0, 60)):
        for name, value in (("eeprom_lock", locked), ("temperature_limit", 60)):
            servo.write(servo.table[name].address, bytes((value,)))
        assert servo.peek("temperature_limit") == 60
        servo.powered = False
        servo.powered = True
        assert servo.peek("temperature_limit") == kept


@pytest.mark.parametrize("voltage", [9.4, 16.1])
def test_a_voltage_error_goes_when_the_voltage_is_good_again(voltage: float):
    servo = powered()
    for supply, error in ((voltage, HardwareError.VOLTAGE), (12.0, 0)):
        sense(servo, voltage=supply)
        assert read(servo, "hardware_error_status") == error
        assert servo.torque_on  # voltage is not in the default shutdown mask
