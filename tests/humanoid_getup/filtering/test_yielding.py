"""Servos that press in vain yield, before their overload protection trips."""

from __future__ import annotations

import numpy as np
import pytest

from humanoid_getup.experiments.judging.torque import LONG_SATURATION
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.reference import straight_path
from humanoid_getup.filtering.yielding import PRESSING, Yielding
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit, load_robot

BEYOND = 1.3  # of its torque, which the pressing servo is asked for
KNEE = 13


def press(robot, limit=FULL_TORQUE, cycles=None):
    """Send one servo a target out of its reach for some cycles, and return what it is sent last."""
    cycles = round(LONG_SATURATION / robot.control_period) if cycles is None else cycles
    yielding, rest = Yielding(robot, limit, 1), np.zeros((1, robot.n))
    torque = np.zeros(robot.n)
    torque[KNEE] = BEYOND * robot.max_torque[KNEE]
    target = sent = robot.compute_lead(torque)[None]
    for _ in range(cycles):
        sent = yielding.soften(target, sent, rest)
    return yielding, target, sent


def test_a_servo_that_presses_yields_before_it_trips_and_the_others_keep_their_targets(op3):
    _, target, sent = press(op3)
    np.testing.assert_allclose(sent[0, KNEE], PRESSING / BEYOND * target[0, KNEE])
    np.testing.assert_array_equal(np.delete(sent, KNEE), np.delete(target, KNEE))


def test_for_a_while_it_may_press_with_all_its_torque(op3):
    _, target, sent = press(op3, cycles=round(0.5 * LONG_SATURATION / op3.control_period))
    np.testing.assert_array_equal(sent, target)


def test_it_follows_its_targets_again_once_they_are_within_its_reach(op3):
    yielding, target, sent = press(op3)
    near = 0.5 * PRESSING / BEYOND * target
    rest = np.zeros_like(target)
    np.testing.assert_array_equal(yielding.soften(near, sent, rest), near)
    np.testing.assert_array_equal(yielding.soften(target, near, rest), target)


@pytest.mark.parametrize("limit", [TorqueLimit(2.0, "pwm"), TorqueLimit(3.0, "current")])
def test_below_its_stall_torque_a_servo_does_not_trip_and_does_not_yield(op3, limit):
    _, target, sent = press(op3, limit)
    np.testing.assert_array_equal(sent, target)


def test_motors_that_never_trip_do_not_yield():
    _, target, sent = press(load_robot("human"))
    np.testing.assert_array_equal(sent, target)


def test_an_arm_that_is_caught_under_the_body_does_not_trip_its_servos():
    """ToddlerBot on its front: without yielding, an elbow or a shoulder presses for too long."""
    robot = load_robot("toddlerbot")
    world = World(robot)
    fall = sample_falls(world, {"prone": 1}, np.random.default_rng(0))[0].posture
    near = load_database(robot).select(fall, 2)
    candidates = [
        Candidate(
            path=straight_path(fall, align(c.posture, fall), 3.0, robot.control_period),
            connection=c,
            assistance=0.0,
        )
        for c in near
    ]
    rolled = DynamicsFilter(world).roll_out(fall, candidates)
    assert rolled
    assert not any(one.outcome.overloaded for one in rolled)
