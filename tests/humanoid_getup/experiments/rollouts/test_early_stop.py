"""A disturbed rollout ends early, and its verdict is that of the whole hold."""

from dataclasses import replace

import numpy as np
import pytest
from records import make_record

from humanoid_getup.experiments.disturbances import USUAL, Normal, Uniform
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import Stance
from humanoid_getup.experiments.judging.torque import LONG_SATURATION
from humanoid_getup.experiments.rollouts import CHUNK, EarlyStop, Experiment, play
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


# What is known when, on records of a robot that has had its last target after a chunk ------------

PERIOD = 0.01  # s, so that a chunk takes 0.25 s


def chunk(robot, neck=1.0, tilt=0.0, **changes):
    """Make a chunk of a robot upright and at rest, but for what is changed; neck as a share."""
    shape = (1, CHUNK)
    stance = Stance(
        neck_height=np.broadcast_to(neck * robot.standing_neck_height, shape),
        tilt=np.broadcast_to(tilt, shape),
        sole_rise=np.zeros(shape),
        non_foot_contact=np.zeros(shape, dtype=bool),
    )
    return make_record(robot, shape, PERIOD, stance=stance, **changes)


def follow(robot, record, chunks, speed=0.0, length=CHUNK) -> EarlyStop:
    """Show so many chunks of one robot, the same each time, unless it is over before."""
    stop = EarlyStop(robot, np.array([length]), np.array([robot.supply_voltage]))
    for _ in range(chunks):
        if stop.going.any():
            stop.add(np.array([0]), record, np.array([speed]))
    return stop


def verdict(stop: EarlyStop) -> tuple[bool, bool, int]:
    """Return whether it stood, whether it failed, and after how many samples, if it is over."""
    (going,), (stood,), (failed,), (cycles,) = stop.going, stop.stood, stop.failed, stop.cycles
    assert going == (not stood and not failed)
    return bool(stood), bool(failed), int(cycles)


LYING = {"upright": np.zeros((1, CHUNK), dtype=bool)}


@pytest.mark.parametrize(
    ("speed", "chunks", "stood"),
    [(0.029, 3, False), (0.029, 4, True), (0.031, 14, True)],
)
def test_a_stand_counts_once_it_is_at_rest_for_long_enough_or_held(op3, speed, chunks, stood):
    """At rest 0.6 s after the last target, three chunks and a half; else held for 3.3 s."""
    stop = follow(op3, chunk(op3), chunks, speed)
    assert verdict(stop) == (stood, False, chunks * CHUNK)


@pytest.mark.parametrize(
    ("neck", "tilt", "fell"),
    [(0.59, 0.0, True), (0.61, 0.0, False), (0.9, np.radians(61), True), (0.9, 1.0, False)],
)
def test_a_robot_that_is_down_after_its_last_target_has_fallen(op3, neck, tilt, fell):
    """It has for 0.2 s more, and so until the second chunk."""
    assert verdict(follow(op3, chunk(op3, neck, tilt, **LYING), 1)) == (False, False, CHUNK)
    assert verdict(follow(op3, chunk(op3, neck, tilt, **LYING), 2)) == (False, fell, 2 * CHUNK)


def test_a_stand_that_does_not_begin_in_time_does_not_come(op3):
    """It is high and upright, but touches the ground: 1.5 s after the last target, it may not."""
    stop = follow(op3, chunk(op3, **LYING), 9)
    assert verdict(stop) == (False, True, 8 * CHUNK)


@pytest.mark.parametrize("breaks", [False, True])
def test_a_servo_without_reserve_for_long_fails_even_in_a_stand(op3, breaks):
    torque = np.tile(op3.max_torque, (1, CHUNK, 1))
    torque[0, 3] *= 0.0 if breaks else 1.0
    known = int(LONG_SATURATION / PERIOD) + CHUNK  # after that time, and not at it
    stop = follow(op3, chunk(op3, torque=torque), 7, length=4 * CHUNK)
    # At the same moment it has been at rest for 0.75 s.
    assert verdict(stop) == (breaks, not breaks, known)
