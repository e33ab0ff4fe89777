"""Servos moved by keys: one at a time, a step at a press."""

import math

import numpy as np
import pytest
from desk import make_desk

from drivers.safety_guard import SafetyGuard
from drivers.service.servos.jog import JogController
from drivers.twin.backend import Twin

SPEED = math.radians(90.0)


@pytest.fixture
def guard():
    desk = make_desk((1, "XL430-W250"), (3, "XM430-W350"))
    with SafetyGuard(Twin(desk, without_imu=True)) as opened:
        yield opened


@pytest.fixture
def jog(guard):
    controller = JogController(guard.robot, speed=SPEED, torque_limit=guard.robot.max_torque)
    controller.reset(guard.read())
    return controller


def pass_cycles(guard, jog, count: int) -> list:
    return [guard.write(jog.step(guard.read())) for _ in range(count)]


def test_nothing_has_torque_before_the_first_press(guard, jog):
    sent = pass_cycles(guard, jog, 5)
    assert [command.is_limp for command in sent] == [True] * 5


def test_a_press_moves_the_chosen_servo_by_a_step_and_no_other(guard, jog):
    pass_cycles(guard, jog, 2)
    jog.nudge(0.2)
    pass_cycles(guard, jog, 100)
    np.testing.assert_allclose(guard.read().joint_pos, [0.2, 0.0], atol=0.03)


def test_another_servo_is_chosen_and_the_first_is_released(guard, jog):
    pass_cycles(guard, jog, 2)
    jog.nudge(0.2)
    pass_cycles(guard, jog, 100)
    jog.choose(1)
    jog.nudge(-0.3)
    (*_, last) = pass_cycles(guard, jog, 100)
    assert last.torque_limit[0] == 0.0
    assert guard.read().joint_pos[1] == pytest.approx(-0.3, abs=0.03)


def test_presses_add_up_to_the_end_of_the_range_and_no_further(guard, jog):
    pass_cycles(guard, jog, 2)
    for _ in range(30):
        jog.nudge(0.5)
    assert jog.wanted == guard.robot.upper[0]
    pass_cycles(guard, jog, 10)
    assert guard.clips.total == 0


def test_a_target_moves_no_faster_than_the_speed(guard, jog):
    pass_cycles(guard, jog, 2)
    jog.nudge(1.0)
    targets = [command.joint_pos[0] for command in pass_cycles(guard, jog, 50)]
    steps = np.diff(targets)
    assert steps.max() <= SPEED * guard.period + math.tau / 4096
    assert steps.max() > 0.0


def test_the_space_bar_releases_and_the_next_press_starts_where_the_servo_is(guard, jog):
    pass_cycles(guard, jog, 2)
    jog.nudge(0.4)
    pass_cycles(guard, jog, 5)
    jog.release()
    (*_, last) = pass_cycles(guard, jog, 5)
    assert last.is_limp
    here = guard.read().joint_pos[0]
    jog.nudge(0.1)
    assert jog.wanted == pytest.approx(here + 0.1, abs=0.02)


def test_it_ends_when_told_to_and_numbers_of_joints_go_round(jog):
    jog.choose(-1)
    assert jog.joint == 1
    jog.choose(2)
    assert jog.joint == 0
    assert not jog.done
    jog.end()
    assert jog.done
