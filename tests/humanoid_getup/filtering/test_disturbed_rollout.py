"""A disturbed rollout ends early, and its verdict is that of the whole hold."""

import numpy as np
import pytest

from humanoid_getup.experiments.play import (
    Rollout,
    RolloutRandomization,
    randomize_rollouts,
)
from humanoid_getup.experiments.standing import is_upright, judge, measure_stance
from humanoid_getup.filtering.disturbed_rollout import DisturbedRollout, Worlds
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.motion_database import load_database
from robots import TorqueLimit
from robots.kinematics import place

COUNT = 6
STRONG = RolloutRandomization(joints=0.1, root=0.2, friction=(0.3, 1.2))


@pytest.fixture(scope="module")
def motion(op3):
    return next(m for m in load_database(op3).motions if m.name == "prone_push_up_fast")


@pytest.fixture(scope="module")
def worlds(world, motion):
    """Worlds disturbed so much that the robot falls in some of them."""
    start = place(world.robot, world.model, motion.posture(0))
    limit, rng = TorqueLimit(3.4, "pwm"), np.random.default_rng(4)
    starts, parameters = randomize_rollouts(world, start, COUNT, STRONG, limit, rng)
    return Worlds(starts=starts, parameters=parameters)


def test_a_verdict_is_that_of_the_whole_hold_and_costs_less(world, motion, worlds):
    period = world.robot.control_period
    outcome = DisturbedRollout(world, COUNT).play(worlds, [motion.joint_target])
    longer = hold_last(motion.joint_target, len(motion.joint_target) + round(3.3 / period))
    trace = Rollout(world, COUNT).play(
        worlds.starts, np.tile(longer, (COUNT, 1, 1)), worlds.parameters
    )
    upright = is_upright(measure_stance(world, trace), world.robot)
    whole = [judge(u, period) for u in upright]
    assert {s.stood for s in whole} == {True, False}
    assert outcome.stood[0].tolist() == [s.stood for s in whole]
    np.testing.assert_allclose(outcome.stand_time[0], [s.start_time for s in whole])
    assert outcome.simulated < 0.9 * COUNT * len(longer) * period


def test_a_motion_stands_alike_alone_and_among_others(world, motion, worlds):
    alone = DisturbedRollout(world, COUNT).play(worlds, [motion.joint_target])
    still = np.tile(motion.joint_pos[:1], (30, 1))
    both = DisturbedRollout(world, 2 * COUNT).play(worlds, [still, motion.joint_target])
    assert not both.stood[0].any()
    np.testing.assert_array_equal(both.stood[1], alone.stood[0])
    np.testing.assert_array_equal(both.rms_torque[1], alone.rms_torque[0])
    assert np.all(both.progress[0] < both.progress[1].max())


def test_all_is_given_up_when_the_first_has_failed(world, motion, worlds):
    still = np.tile(motion.joint_pos[:1], (30, 1))
    given_up = DisturbedRollout(world, 2 * COUNT).play(
        worlds, [still, motion.joint_target], give_up=True
    )
    assert not given_up.stood.any()
    assert given_up.simulated <= 2 * COUNT * 0.61


def test_worlds_can_be_taken_out(worlds):
    some = worlds.take(np.array([0, 4]))
    assert len(some) == 2
    np.testing.assert_array_equal(some.starts[1], worlds.starts[4])
    assert some.parameters.friction[1] == worlds.parameters.friction[4]
