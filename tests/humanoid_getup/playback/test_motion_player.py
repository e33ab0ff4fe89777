"""The player sends a motion's targets on time, after a gentle way to the first."""

import numpy as np
import pytest
from recording_backend import still_state

from drivers import State
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.play import APPROACH_SPEED, MotionPlayer
from robots import Robot

PERIOD = 0.008
HOLD = 0.4


@pytest.fixture(scope="module")
def motion(op3: Robot) -> Motion:
    time = 7.0 + np.arange(0.0, 1.0, PERIOD)  # a motion's clock may begin anywhere
    joint_pos = 0.1 + 0.3 * np.sin(3.0 * (time - 7.0))[:, None] * np.ones(op3.n)
    return Motion(
        name="wave",
        robot="op3",
        start_class="supine",
        strategy="waving",
        time=time,
        position=np.zeros((len(time), 3)),
        orientation=np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1)),
        joint_pos=joint_pos,
        joint_target=joint_pos + 0.02,
    )


def measure(robot: Robot, time: float, joint_pos: np.ndarray) -> State:
    return still_state(robot, time=time, joint_pos=joint_pos)


def play(player: MotionPlayer, robot: Robot, start: np.ndarray, begin: float) -> np.ndarray:
    """Play to the end against a robot that stays where it is; return the targets (T, n)."""
    player.reset(measure(robot, begin, start))
    sent, time = [], begin
    while not player.done:
        sent.append(player.step(measure(robot, time, start)).joint_pos)
        time += PERIOD
        assert time - begin < 60.0
    return np.array(sent)


def test_from_its_own_start_a_motion_is_sent_as_it_is_and_held(op3: Robot, motion: Motion):
    player = MotionPlayer(op3, motion, hold=HOLD)
    sent = play(player, op3, motion.joint_pos[0], begin=3.0)
    frames = len(motion.time)
    np.testing.assert_allclose(sent[:frames], motion.joint_target, atol=1e-9)
    np.testing.assert_allclose(sent[frames:], np.tile(motion.joint_target[-1], (50, 1)), atol=1e-9)
    assert player.approach_time == 0.0


def test_from_elsewhere_the_way_to_the_first_targets_is_slow_and_without_a_jump(op3, motion):
    player = MotionPlayer(op3, motion, hold=HOLD)
    start = motion.joint_target[0] + np.linspace(-0.6, 0.3, op3.n)
    sent = play(player, op3, start, begin=0.0)
    assert player.approach_time == pytest.approx(0.6 / APPROACH_SPEED)
    np.testing.assert_allclose(sent[0], start)
    way = sent[: int(player.approach_time / PERIOD)]
    # The first targets lie 0.02 rad beyond the first angles, on which the time is set.
    most = (0.6 + 0.02) / 0.6 * APPROACH_SPEED * PERIOD
    assert np.abs(np.diff(way, axis=0)).max() <= most + 1e-12
    np.testing.assert_allclose(sent[-1], motion.joint_target[-1])
