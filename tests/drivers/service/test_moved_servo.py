"""One servo moves through the guard, within its own limits, no faster than it may."""

import math
from dataclasses import replace

import numpy as np
import pytest
from desk import BAUD, LIMITED, make_desk, serving_desk

from drivers.control_loop import Ending, engaged, run_engaged
from drivers.dynamixel.diagnostics import DiagnosticsError
from drivers.errors import SetupError
from drivers.safety_guard import SafetyGuard
from drivers.service import moved_servo
from drivers.service.moved_servo import Move, MoveController, find_bench
from drivers.twin.backend import Twin

MOVE = Move(
    joint=0, target=0.5, is_relative=False, speed=math.radians(60.0), torque_limit=0.7, hold=0.4
)


@pytest.fixture
def guard():
    return SafetyGuard(Twin(make_desk((1, "XL430-W250"), (3, "XM430-W350")), without_imu=True))


def play(guard: SafetyGuard, move: Move):
    sent, write = [], guard.write

    def record(command):
        sent.append(command)
        return write(command)

    guard.write = record
    with engaged(guard):
        controller = MoveController(guard.robot, move, guard.read())
        report = run_engaged(controller, guard, max_time=controller.duration + 1.0)
    return controller, report, sent


def test_a_joint_arrives_no_faster_than_its_speed_and_all_others_stay_limp(guard):
    there, report, sent = play(guard, MOVE)
    assert report.ending is Ending.DONE
    assert report.duration == pytest.approx(there.duration, abs=3 * guard.period)
    assert there.angle == pytest.approx(0.5, abs=0.05)
    steps = np.abs(np.diff([command.joint_pos for command in sent], axis=0)).max(axis=0)
    assert 0.9 < steps[0] / (MOVE.speed * guard.period) <= 1.001
    torque = np.array([command.torque_limit for command in sent])
    assert (torque[:, 0] == 0.7).all()
    assert (torque[:, 1] == 0.0).all()
    back, _, _ = play(guard, replace(MOVE, target=-0.2, is_relative=True))
    assert back.target == pytest.approx(back.start - 0.2)
    assert back.angle == pytest.approx(0.3, abs=0.05)


def test_a_key_pressed_before_a_move_stops_it_and_a_target_beyond_the_range_is_refused(guard):
    guard.stop("a person pressed a key")
    moved, report, _ = play(guard, MOVE)
    assert report.ending is Ending.FAULT
    assert "a person pressed a key" in report.reason
    assert moved.angle == pytest.approx(0.0, abs=0.01)
    guard.clear()
    with pytest.raises(SetupError, match=r"target is \+515.7°, expected -180.0° to \+179.9°"):
        play(guard, replace(MOVE, target=9.0))


def test_the_driver_moves_a_servo_and_leaves_it_limp():
    with serving_desk((3, "XM430-W350")) as served:
        moved, report, _ = play(SafetyGuard(served.make_driver(without_imu=True)), MOVE)
        assert report.ending is Ending.DONE
        assert moved.angle == pytest.approx(0.5, abs=0.03)
        assert served.peek("torque_enable") == [0]


# A bench of one servo ----------------------------------------------------------------------------


def test_the_limits_that_a_servo_keeps_are_its_range_and_are_not_written(desk, monkeypatch):
    for register, value in LIMITED.items():
        desk.poke("servo_3", register, value)
    bench, changes = find_bench(desk.path, 3, BAUD, None)
    assert bench.joint_names == ("servo_3",)
    np.testing.assert_allclose([bench.lower, bench.upper], [[-math.pi / 2], [math.pi / 2]])
    assert changes["return_delay_time"] == 0
    assert not LIMITED.keys() & changes.keys()
    assert desk.peek("return_delay_time") == [250, 250]  # nothing is written
    monkeypatch.setattr(moved_servo, "read_latency", lambda _: 0.016)  # an adapter holds replies
    slow, _ = find_bench(desk.path, 1, BAUD, None)
    assert bench.control_period == 0.01
    assert 0.75 * slow.control_period > 2 * 0.016 + 0.001  # reading has three quarters of it


def test_a_servo_without_a_range_or_with_a_wrong_supply_is_refused(desk):
    desk.poke("servo_1", "min_position_limit", 3000)
    desk.poke("servo_1", "max_position_limit", 3000)
    with pytest.raises(SetupError, match="min_position_limit is 3000 and max_position_limit 3000"):
        find_bench(desk.path, 1, BAUD, None)
    desk.poke("servo_3", "min_voltage_limit", 130)
    with pytest.raises(DiagnosticsError, match=r"supply is 11.1 V, expected 13.0 to 14.8 V"):
        find_bench(desk.path, 3, BAUD, None)
