"""Servos that reply on a port become a bench within the limits that they keep."""

import math

import numpy as np
import pytest
from desk import BAUD, LIMITED

from drivers.errors import SetupError
from drivers.service.servos import found_bench
from drivers.service.servos.found_bench import find_bench
from drivers.service.servos.loose_servo import NoServoError


def test_the_limits_that_a_servo_keeps_are_the_range_of_its_joint(desk):
    for register, value in LIMITED.items():
        desk.poke("servo_3", register, value)
    found = find_bench(desk.path, baud=BAUD)
    assert found.bench.joint_names == ("servo_1", "servo_3")
    np.testing.assert_allclose(found.bench.lower, [-math.pi, -math.pi / 2])
    np.testing.assert_allclose(found.bench.upper, [math.pi - math.tau / 4096, math.pi / 2])


def test_what_the_driver_would_write_is_listed_and_not_the_limits(desk):
    for register, value in LIMITED.items():
        desk.poke("servo_3", register, value)
    found = find_bench(desk.path, (3,), BAUD)
    (line,) = found.describe_eeprom()
    assert line.startswith("servo_3: return_delay_time = 0")
    assert "position_limit" not in line
    assert desk.peek("return_delay_time") == [250, 250]  # nothing is written


def test_a_servo_that_does_not_reply_is_named(desk):
    with pytest.raises(NoServoError, match="no servo of id 7, 8 replies"):
        find_bench(desk.path, (1, 7, 8), BAUD)


def test_a_servo_without_a_range_is_refused(desk):
    desk.poke("servo_1", "min_position_limit", 3000)
    desk.poke("servo_1", "max_position_limit", 3000)
    with pytest.raises(SetupError, match="min_position_limit is 3000 and max_position_limit 3000"):
        find_bench(desk.path, baud=BAUD)


def test_an_adapter_that_holds_replies_back_gets_a_longer_period(desk, monkeypatch):
    quick = find_bench(desk.path, baud=BAUD).bench
    monkeypatch.setattr(found_bench, "read_latency", lambda _: 0.016)
    slow = find_bench(desk.path, baud=BAUD).bench
    assert quick.control_period == 0.01
    assert 0.75 * slow.control_period > 2 * 0.016 + 0.001  # reading has three quarters of it
