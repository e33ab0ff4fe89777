"""Servos move through waypoints, guarded, no faster than they may."""

import math

import numpy as np
import pytest
from desk import make_desk, serving_desk

from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.errors import SetupError
from drivers.safety_guard import SafetyGuard
from drivers.service.servos.waypoints import (
    WaypointController,
    make_move,
    make_wiggle,
    move_through,
)
from drivers.state import State
from drivers.twin.backend import Twin

SPEED = math.radians(60.0)


def play(guard: SafetyGuard, waypoints: list[list[float]], speed: float = SPEED):
    robot = guard.robot
    controller = WaypointController(
        robot, np.array(waypoints), speed=speed, torque_limit=robot.max_torque
    )
    return move_through(guard, lambda _: controller, realtime=False)


@pytest.fixture
def guard():
    return SafetyGuard(Twin(make_desk((1, "XL430-W250"), (3, "XM430-W350")), without_imu=True))


def test_each_servo_arrives_at_each_waypoint(guard):
    done = play(guard, [[0.5, -0.5], [-0.3, 1.0]])
    assert done.is_whole
    assert len(done.arrivals) == 2
    for arrival in done.arrivals:
        np.testing.assert_allclose(arrival.reached, arrival.wanted, atol=0.05)
    assert done.report.clips.total == 0


def test_targets_never_move_faster_than_the_speed(guard):
    targets = []
    guard.write = _recording(guard.write, targets)
    play(guard, [[1.0, -1.0], [0.0, 0.0]])
    steps = np.abs(np.diff(np.array(targets), axis=0))
    assert len(steps) > 50
    assert steps.max() <= SPEED * guard.period * 1.001
    assert steps.max() > 0.9 * SPEED * guard.period


def test_a_joint_without_a_target_stays_limp(guard):
    commands = []
    guard.write = _recording(guard.write, commands, "torque_limit")
    play(guard, [[0.3, math.nan]])
    torque = np.array(commands)
    assert (torque[:, 1] == 0.0).all()
    assert (torque[:, 0] > 0.0).any()


def test_a_move_ends_when_the_guard_stops_it(guard):
    guard.stop("a person pressed a key")
    guard.connect = lambda: SafetyGuard.connect(guard)
    done = play(guard, [[0.5, 0.5]])
    assert not done.is_whole
    assert "a person pressed a key" in done.report.reason


def test_a_wiggle_stays_in_the_range_and_comes_back():
    desk = make_desk((1, "XL430-W250"), (3, "XM430-W350"))
    middle = make_wiggle(np.zeros(2), 1, 0.1, desk)
    np.testing.assert_allclose(middle[:, 1], [0.1, -0.1, 0.0])
    assert np.isnan(middle[:, 0]).all()
    at_end = make_wiggle(desk.upper, 0, 0.1, desk)
    np.testing.assert_allclose(at_end[:, 0], desk.upper[0] - np.array([0.1, 0.1, 0.0]))
    beyond = make_wiggle(desk.lower - 1.0, 0, 0.1, desk)
    np.testing.assert_allclose(beyond[:, 0], desk.lower[0])


def test_the_driver_moves_a_servo_and_leaves_it_limp_within_its_own_limits():
    with serving_desk((3, "XM430-W350")) as served:
        robot = served.robot
        backend = DynamixelBackend(robot, served.path, clock=CycleClock(), without_imu=True)
        done = play(SafetyGuard(backend), [[0.4]])
        assert done.is_whole
        assert abs(done.arrivals[0].reached[0] - 0.4) < 0.03
        assert served.peek("torque_enable") == [0]


def test_the_estimated_time_is_that_of_the_move(guard):
    controller = WaypointController(
        guard.robot, np.array([[0.5, -1.0]]), speed=SPEED, torque_limit=guard.robot.max_torque
    )
    estimate = controller.estimate_duration(np.zeros(2))
    done = move_through(guard, lambda _: controller, realtime=False)
    assert done.report.duration == pytest.approx(estimate, abs=3 * guard.period)


def _recording(write, kept: list, name: str = "joint_pos"):
    def record(command):
        kept.append(getattr(command, name).copy())
        return write(command)

    return record


def test_a_controller_without_a_way_to_go_waits_and_keeps_the_largest_current_of_each_wait():
    desk = make_desk((1, "XL430-W250"))
    controller = WaypointController(
        desk, np.zeros((2, 1)), speed=SPEED, torque_limit=desk.max_torque, dwell=0.1
    )
    controller.reset(_state(0.0))
    for time, current in ((0.05, -0.7), (0.11, 0.3), (0.15, 0.2), (0.2, 0.1)):
        controller.step(_state(time, current))
        assert not controller.done
    controller.step(_state(0.22))
    assert controller.done
    assert [arrival.current.tolist() for arrival in controller.arrivals] == [[0.7], [0.2]]


def _state(time: float, current: float = 0.0) -> State:
    return State(
        time=time,
        joint_pos=np.zeros(1),
        joint_vel=np.zeros(1),
        joint_current=np.full(1, current),
        gyro=np.zeros(0),
        orientation=np.zeros(0),
        temperature=np.full(1, 25.0),
        voltage=12.0,
    )


def test_a_stop_between_two_moves_stops_the_next_one(guard):
    assert play(guard, [[0.2, 0.0]]).is_whole
    guard.stop("a person pressed a key")
    done = play(guard, [[0.4, 0.0]])
    assert not done.is_whole
    assert not done.arrivals
    assert "a person pressed a key" in done.report.reason


def test_a_target_beyond_the_range_is_refused_with_torque_off(guard):
    commands = []
    guard.write = _recording(guard.write, commands, "torque_limit")

    def make(start: np.ndarray) -> WaypointController:
        del start
        waypoints = make_move(0, 9.0, guard.robot)
        return WaypointController(
            guard.robot, waypoints, speed=SPEED, torque_limit=guard.robot.max_torque
        )

    with pytest.raises(SetupError, match=r"target is \+515.7°, expected -180.0° to \+179.9°"):
        move_through(guard, make, realtime=False)
    assert not np.any(commands)
