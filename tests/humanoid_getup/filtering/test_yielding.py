"""Servos that press in vain yield, before their overload protection trips."""

from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.torque import LONG_SATURATION
from humanoid_getup.filtering.candidate import Candidate, straight_path
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.tracking import PRESSING, Yielding
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit, load_robot

BEYOND = 1.3  # of its torque, which the pressing servo is asked for
KNEE = 13


def press(robot, limit=FULL_TORQUE, cycles=None, share=BEYOND):
    """Send one servo of the first of two robots a target out of its reach for some cycles.

    Return what was sent last, and what was asked, (2, n).
    """
    cycles = round(LONG_SATURATION / robot.control_period) if cycles is None else cycles
    yielding, stance = Yielding(robot, limit, 2), np.tile(robot.standing.joint_pos, (2, 1))
    torque = np.zeros((2, robot.n))
    torque[0, KNEE] = share * robot.max_torque[KNEE]
    target = sent = stance + robot.compute_lead(torque)
    for _ in range(cycles):
        sent = target + yielding.ease(target, sent, stance)
    return yielding, stance, target, sent


@pytest.mark.parametrize("name", ["op3", "toddlerbot"])
def test_a_servo_that_presses_yields_before_it_trips_and_nothing_else_changes(name):
    robot = load_robot(name)
    _, stance, target, sent = press(robot)
    lead = (target - stance)[0, KNEE]
    np.testing.assert_allclose((sent - stance)[0, KNEE], PRESSING / BEYOND * lead)
    np.testing.assert_array_equal(np.delete(sent, KNEE), np.delete(target, KNEE))


def test_for_a_while_it_may_press_and_it_follows_targets_within_its_reach_again(op3):
    _, _, target, sent = press(op3, cycles=round(0.5 * LONG_SATURATION / op3.control_period))
    np.testing.assert_array_equal(sent, target)
    yielding, stance, target, sent = press(op3)
    near = stance + 0.5 * PRESSING / BEYOND * (target - stance)
    np.testing.assert_array_equal(yielding.ease(near, sent, stance), np.zeros_like(near))
    np.testing.assert_array_equal(yielding.ease(target, near, stance), np.zeros_like(near))


@pytest.mark.parametrize(("by", "yields"), [("pwm", False), ("current", True)])
def test_a_weak_supply_saturates_sooner_where_the_gain_does_not_shrink_with_it(op3, by, yields):
    weak = replace(op3, supply_voltage=0.9 * op3.supply_voltage)
    _, _, target, sent = press(weak, TorqueLimit(by=by), share=0.95)
    assert np.array_equal(sent, target) is not yields


@pytest.mark.slow
def test_an_arm_that_is_caught_under_the_body_does_not_trip_its_servos(monkeypatch):
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
    dynamics = DynamicsFilter(world)
    rolled = dynamics.roll_out(fall, candidates)
    assert not any(one.outcome.overloaded for one in nonempty(rolled))
    for one in rolled:  # what is played by others holds its last targets
        hold = one.target[one.moving :]
        np.testing.assert_allclose(hold, np.tile(hold[-1], (len(hold), 1)), atol=1e-12)
    monkeypatch.setattr(Yielding, "ease", lambda _, target, *__: 0.0 * target)
    pressing = dynamics.roll_out(fall, candidates)
    assert any(one.outcome.overloaded for one in pressing)
