"""The figures of `benchmarks/planning_or_filtering.py`: depth, slip, collisions and jerk."""

from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from benchmark_scripts import load_script

from humanoid_getup.motions.motion import NO_END, Motion
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion

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


def test_a_stand_that_is_kept_is_perfect(script: ModuleType, world: World):
    kept = make_motion(world.robot, [world.robot.standing] * FRAMES)
    quality = script.measure_quality(world, kept)
    assert quality.slip_m == quality.jerk_rad_s3 == quality.self_collisions == 0
    assert quality.ground_depth_m < 0.002


def test_both_feet_slide_when_a_stand_is_pushed(script: ModuleType, world: World):
    stand, way = world.robot.standing, np.array([0.6, 0.8, 0.0])
    pushed = [shift(stand, 0.1 * way * share) for share in np.linspace(0.0, 1.0, FRAMES)]
    assert script.measure_quality(world, make_motion(world.robot, pushed)).slip_m == pytest.approx(
        0.2, rel=0.01
    )


def test_what_is_lifted_off_the_ground_does_not_slide(script: ModuleType, world: World):
    stand = shift(world.robot.standing, 0.01 * UP)
    moved = [shift(stand, np.array([0.1 * share, 0.0, 0.0])) for share in np.linspace(0, 1, FRAMES)]
    assert script.measure_quality(world, make_motion(world.robot, moved)).slip_m == 0.0


def test_a_foot_that_turns_about_its_edge_hardly_slides(script: ModuleType, world: World):
    """The robot leans by 0.2 rad about the front edges of its soles."""
    stand, across = world.robot.standing, np.array([0.0, 1.0, 0.0])
    toe = np.array([0.065, 0.0, 0.0])
    tipped = []
    for angle in np.linspace(0.0, 0.2, FRAMES):
        turn = quaternion.from_axis_angle(across, angle)
        tipped.append(
            replace(
                stand,
                position=toe + quaternion.rotate(turn, stand.position - toe),
                orientation=quaternion.multiply(turn, stand.orientation),
            )
        )
    assert script.measure_quality(world, make_motion(world.robot, tipped)).slip_m < 0.01


def test_depth_in_the_ground_is_what_a_stand_is_lowered_by(script: ModuleType, world: World):
    stand = world.robot.standing
    at_rest = script.measure_quality(world, make_motion(world.robot, [stand] * FRAMES))
    lower = [shift(stand, -0.01 * UP * share) for share in np.linspace(0.0, 1.0, FRAMES)]
    deep = script.measure_quality(world, make_motion(world.robot, lower))
    assert deep.ground_depth_m - at_rest.ground_depth_m == pytest.approx(0.01, abs=0.001)


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
