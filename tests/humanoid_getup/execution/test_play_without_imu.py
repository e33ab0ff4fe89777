"""A motion on a robot without an IMU: played open loop, and nothing claimed about its stand."""

from dataclasses import replace

import numpy as np
import pytest

from drivers import Ending, SafetyGuard, Twin, run
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.judge import SensorJudge
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import StoredMotion
from robots import Posture, Robot, quaternion
from robots.kinematics import read_posture

UNKNOWN = AttemptStatus.PLAYED.value


@pytest.fixture(scope="module")
def bare(op3: Robot) -> World:
    """An OP3 without an IMU, and without the board that carries it."""
    assert op3.bus is not None
    bus = replace(op3.bus, board=None)
    return World(replace(op3, imu_site=None, bus=bus))


@pytest.fixture(scope="module")
def squat(bare: World):
    return find_motion(bare.robot, "squat_to_stand")


def place_at_start(world: World, motion) -> Posture:
    return read_posture(world.robot, world.model, settle_posture(world, motion.posture(0)))


def play_on_twin(world: World, motion, start: Posture, **options):
    sent = []
    twin = Twin(world, start, without_imu=True)
    result = play(twin, motion, on_cycle=lambda cycle: sent.append(cycle.sent.joint_pos), **options)
    return result, np.array(sent)


def play(backend, motion, **options) -> Rise:
    """Play a motion once, on a robot that is taken to lie where it begins."""
    body = backend.backend if isinstance(backend, SafetyGuard) else backend
    world = World(body.robot)
    chosen = SessionOptions(
        settle=False, assumed_start=place_at_start(world, motion), **{"then": "limp"} | options
    )
    return get_up(backend, StoredMotion(world, motion), max_attempts=1, options=chosen)


def test_a_motion_is_played_alike_however_the_robot_is_turned_and_no_stand_is_claimed(bare, squat):
    start = place_at_start(bare, squat)
    turn = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.5 * np.pi)
    turned = replace(
        start,
        position=start.position + np.array([0.0, 0.0, 1.0]),
        orientation=quaternion.multiply(start.orientation, turn),
    )
    played, sent = play_on_twin(bare, squat, start)
    assert played.status is AttemptStatus.PLAYED
    figures = played.figures()
    assert (figures.stood, figures.judged_by, figures.start_class) == (None, None, None)
    assert 0.0 < figures.peak_torque_nm <= bare.robot.max_torque.max()
    assert np.abs(sent[-1] - squat.joint_target[-1]).max() < 0.002  # whole ticks
    result, again = play_on_twin(bare, squat, turned)
    cycles = min(len(sent), len(again))
    assert cycles > round(squat.duration / bare.robot.control_period)
    assert np.array_equal(sent[:cycles], again[:cycles])
    assert result.reason == UNKNOWN  # it lies, which is unknown, too


def test_a_robot_that_is_held_keeps_its_last_targets_until_a_key_is_pressed(bare, squat):
    asked = []

    def is_released() -> bool:
        asked.append(True)
        return len(asked) > 50

    start = place_at_start(bare, squat)
    twin = Twin(bare, start, without_imu=True)
    sent = []
    result = play(
        twin,
        squat,
        then="hold",
        is_released=is_released,
        on_cycle=lambda cycle: sent.append(cycle.sent.joint_pos),
    )
    assert result.figures().held_s >= 45 * bare.robot.control_period
    assert np.array_equal(sent[-1], sent[-40])
    assert not twin.simulation.has_torque
    assert result.reason == UNKNOWN


def test_a_motion_that_falls_by_itself_is_refused_before_any_torque(bare, squat):
    backwards = replace(squat, joint_target=squat.joint_target[:1].repeat(len(squat.time), axis=0))
    result, sent = play_on_twin(bare, backwards, place_at_start(bare, squat))
    assert result.run is None
    assert "does not end in a held stand" in result.reason
    assert len(sent) == 0


def test_the_judge_by_sensors_ends_a_run_without_an_orientation(world, squat):
    judge = SensorJudge(world, world.robot.control_period, None)
    guard = SafetyGuard(Twin(world, place_at_start(world, squat), without_imu=True))
    report = run(MotionPlayer(world.robot, squat, hold=0.0), guard, max_time=1.0, on_cycle=judge)
    assert report.ending is Ending.FAULT
    assert "has no IMU" in report.reason
    assert not judge.end()
