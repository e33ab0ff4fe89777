"""Servos that are read again and again keep the range that they have been through."""

from desk import BAUD

from drivers.service.servos.gauges import Gauges
from drivers.service.servos.loose_servo import find_any


def test_the_range_grows_with_what_was_seen_and_nothing_is_written(desk, bus):
    servos = find_any(bus, (BAUD,))
    before = [servo.read_table() for servo in servos]
    gauges = Gauges(bus, servos)
    for angle in (0.0, 30.0, -60.0, 10.0):
        desk.place(servo_1=angle)
        gauges.read()
    first, second = gauges.all
    assert (first.lowest, first.highest) == (2048 - 683, 2048 + 341)
    assert (second.lowest, second.highest) == (2048, 2048)
    assert list(first.positions) == [2048, 2389, 1365, 2162]
    kept = ("torque_enable", "operating_mode", "return_delay_time", "goal_position")
    after = [servo.read_table() for servo in servos]
    assert [{n: t[n] for n in kept} for t in after] == [{n: t[n] for n in kept} for t in before]


def test_a_silent_servo_keeps_its_last_values_and_counts_what_it_missed(desk, bus):
    gauges = Gauges(bus, find_any(bus, (BAUD,)))
    gauges.read()
    desk.virtual.servos[0].powered = False
    gauges.read()
    gauges.read()
    assert [gauge.missed for gauge in gauges.all] == [2, 0]
    assert gauges.all[0].values["present_temperature"] == 25


def test_a_servo_without_a_current_sensor_has_a_load_and_one_with_it_a_current(bus):
    gauges = Gauges(bus, find_any(bus, (BAUD,)))
    assert gauges.all[0].angle is None
    gauges.read()
    xl, xm = gauges.all
    assert (xl.to_si("present_current"), xl.to_si("present_load")) == (None, 0.0)
    assert (xm.to_si("present_current"), xm.to_si("present_load")) == (0.0, None)
    assert xl.angle == 0.0
