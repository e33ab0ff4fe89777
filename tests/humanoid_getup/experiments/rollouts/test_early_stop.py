"""A disturbed rollout ends early, and its verdict is that of the whole hold."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.distributions import Normal, Uniform
from humanoid_getup.experiments.disturbances.disturbance import USUAL
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts.play import Experiment, play
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.motion_database import load_database
from robots import TorqueLimit
from robots.kinematics import place

COUNT = 6
STRONG = replace(USUAL, joints=Normal(0.1), turn=Normal(0.2), ground_friction=Uniform(0.3, 1.2))


@pytest.fixture(scope="module")
def motion(op3):
    return next(m for m in load_database(op3).motions if m.name == "prone_push_up_fast")


@pytest.fixture(scope="module")
def worlds(world, motion):
    """Worlds disturbed so much that the robot falls in some of them."""
    start = place(world.robot, world.model, motion.posture(0))
    limit, rng = TorqueLimit(3.4, "pwm"), np.random.default_rng(4)
    return STRONG.sample(world, start, COUNT, rng, limit)


def test_a_verdict_is_that_of_the_whole_hold_and_costs_less(world, motion, worlds):
    period = world.robot.control_period
    outcome = Experiment(world).compare(worlds, [motion.joint_target])
    longer = hold_last(motion.joint_target, len(motion.joint_target) + round(3.3 / period))
    whole = Outcome(play(world, worlds, [longer] * COUNT), world.robot)
    assert set(whole.stood.tolist()) == {True, False}
    assert outcome.stood[0].tolist() == whole.stood.tolist()
    np.testing.assert_array_equal(outcome.stand_time[0], whole.stand_time)
    for figure in ("rms_torque", "neck_delta_v"):  # of the way up
        early, late = getattr(outcome, figure)[0], getattr(whole, figure)
        np.testing.assert_array_equal(early[whole.stood], late[whole.stood])
    assert outcome.record.duration < 0.9 * COUNT * len(longer) * period


def test_a_motion_stands_alike_alone_and_among_others(world, motion, worlds):
    alone = Experiment(world).compare(worlds, [motion.joint_target])
    still = np.tile(motion.joint_pos[:1], (30, 1))
    both = Experiment(world).compare(worlds, [still, motion.joint_target])
    assert not both.stood[0].any()
    np.testing.assert_array_equal(both.stood[1], alone.stood[0])
    np.testing.assert_array_equal(both.rms_torque[1], alone.rms_torque[0])
    assert np.all(both.progress[0] < both.progress[1].max())


def test_all_is_given_up_when_the_first_has_failed(world, motion, worlds):
    still = np.tile(motion.joint_pos[:1], (30, 1))
    given_up = Experiment(world).compare(worlds, [still, motion.joint_target], give_up=True)
    assert not given_up.stood.any()
    assert given_up.record.duration <= 2 * COUNT * 0.61


def test_worlds_can_be_taken_out(worlds):
    some = worlds.take(np.array([0, 4]))
    assert len(some) == 2
    np.testing.assert_array_equal(some.starts[1], worlds.starts[4])
    assert some.parameters.friction[1] == worlds.parameters.friction[4]
