"""The figures of `benchmarks/planning_or_filtering.py`: depth, slip, collisions and jerk."""

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from benchmark_scripts import load_script

from humanoid_getup.motions.motion import NO_END, Motion
from humanoid_getup.simulation.world import World
from robots import Posture, Robot

FRAMES = 51
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return load_script("planning_or_filtering")


def make_motion(robot: Robot, postures: list[Posture]) -> Motion:
    return Motion.through(
        postures,
        robot.control_period,
        name="made_up",
        robot=robot.name,
        start_class="squat",
        end_class=NO_END,
        strategy="test",
        joint_target=np.array([posture.joint_pos for posture in postures]),
    )


def shift(posture: Posture, by: np.ndarray) -> Posture:
    return replace(posture, position=posture.position + by)


def test_a_stand_that_is_kept_is_perfect_and_one_that_is_lowered_as_deep(
    script: ModuleType, world: World
):
    stand = world.robot.standing
    kept = script.measure_quality(world, make_motion(world.robot, [stand] * FRAMES))
    assert kept.slip_m == kept.jerk_rad_s3 == kept.self_collisions == 0
    assert kept.ground_depth_m < 0.002
    lower = [shift(stand, -0.01 * UP * share) for share in np.linspace(0.0, 1.0, FRAMES)]
    deep = script.measure_quality(world, make_motion(world.robot, lower))
    assert deep.ground_depth_m - kept.ground_depth_m == pytest.approx(0.01, abs=0.001)


def test_both_feet_slide_when_a_stand_is_pushed_but_not_above_the_ground(
    script: ModuleType, world: World
):
    stand, way = world.robot.standing, np.array([0.6, 0.8, 0.0])
    for height, slip in ((0.0, 0.2), (0.01, 0.0)):
        shares = np.linspace(0.0, 1.0, FRAMES)
        pushed = [shift(stand, 0.1 * way * share + height * UP) for share in shares]
        quality = script.measure_quality(world, make_motion(world.robot, pushed))
        assert quality.slip_m == pytest.approx(slip, rel=0.01)


def test_jerk_is_that_of_a_sine(script: ModuleType, world: World):
    """The third derivative of A sin(w t) has an RMS of A w^3 / sqrt(2), in one of n joints."""
    robot, amplitude, speed = world.robot, 0.2, 2.0 * np.pi * 2.0
    knee = robot.joint_names.index("l_knee")
    postures = []
    for k in range(round(1.0 / robot.control_period) + 1):
        joint_pos = robot.standing.joint_pos.copy()
        joint_pos[knee] += amplitude * np.sin(speed * k * robot.control_period)
        postures.append(replace(robot.standing, joint_pos=joint_pos))
    jerk = script.measure_quality(world, make_motion(robot, postures)).jerk_rad_s3
    assert jerk == pytest.approx(amplitude * speed**3 / np.sqrt(2.0 * robot.n), rel=0.03)


def test_arms_that_pass_through_the_body_collide_each_time(script: ModuleType, world: World):
    robot = world.robot
    inward = robot.joint_names.index("l_sho_roll")
    postures = []
    for k in range(200):
        joint_pos = robot.standing.joint_pos.copy()
        joint_pos[inward] += 1.2 * np.sin(2.0 * np.pi * k / 100) * np.sign(joint_pos[inward] or 1.0)
        postures.append(replace(robot.standing, joint_pos=joint_pos))
    quality = script.measure_quality(world, make_motion(robot, postures))
    assert quality.self_collisions == 2
