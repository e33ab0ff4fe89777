import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.experiments.starts.falls import FallSet, classify, sample_fall_set, sample_falls
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots import quaternion
from robots.kinematics import lowest_point, place

# Attitudes of op3-facts, section 7: rotation axis and angle from upright.
ATTITUDES = {
    "supine": ([0.0, 1.0, 0.0], -np.pi / 2),
    "prone": ([0.0, 1.0, 0.0], np.pi / 2),
    "left": ([1.0, 0.0, 0.0], -np.pi / 2),
    "right": ([1.0, 0.0, 0.0], np.pi / 2),
}


@pytest.fixture(scope="module")
def falls(world):
    return sample_falls(world, {"supine": 2, "prone": 2, "lateral": 2}, np.random.default_rng(5))


@pytest.mark.parametrize("yaw", [0.0, -2.5])
def test_gravity_names_the_class_whatever_the_heading(yaw):
    for name, (axis, angle) in nonempty(ATTITUDES.items()):
        lying = quaternion.from_axis_angle(np.array(axis), angle)
        assert classify(quaternion.multiply(quaternion.from_yaw(yaw), lying)) == name


def test_every_class_has_its_count_and_its_name(falls):
    found = [fall.start_class for fall in falls]
    assert found[:4] == ["supine"] * 2 + ["prone"] * 2
    assert set(found[4:]) <= {"left", "right"}
    assert len(found) == 6
    for fall in falls:
        assert classify(fall.posture.orientation) == fall.start_class


def test_a_fallen_robot_rests_on_the_ground_within_its_limits(falls, world):
    robot = world.robot
    for fall in nonempty(falls):
        lowest = lowest_point(world.model, place(robot, world.model, fall.posture))
        assert -0.004 < lowest < 0.001
        assert np.all(fall.posture.joint_pos >= robot.lower)
        assert np.all(fall.posture.joint_pos <= robot.upper)


def test_a_fallen_robot_stays_where_it_is(falls, world):
    robot = world.robot
    starts = np.array([place(robot, world.model, fall.posture) for fall in falls])
    limp = DomainParameters.nominal(world, len(falls), torque_limit=0.0)
    trace = play(
        world, Scenarios(starts=starts, parameters=limp), np.zeros((len(falls), 125, robot.n))
    )
    turned = quaternion.angle_between(trace.qpos[:, -1, 3:7], starts[:, 3:7])
    assert np.all(turned < np.radians(3.0))


def test_one_seed_gives_one_set_and_almost_every_drop_settles(world, tmp_path):
    fall_set = sample_fall_set(world, {"supine": 1, "lateral": 1}, seed=5)
    assert len(fall_set.falls) == 2
    assert fall_set.dropped is not None and fall_set.dropped % 24 == 0
    assert fall_set.left_out is not None and fall_set.left_out <= 0.05 * fall_set.dropped
    file = tmp_path / "falls.npz"
    fall_set.save(file)
    again = sample_fall_set(world, {"supine": 1, "lateral": 1}, seed=5)
    for a, b in nonempty(zip(fall_set.falls, again.falls, strict=True)):
        np.testing.assert_array_equal(a.posture.joint_pos, b.posture.joint_pos)
    loaded = FallSet.load(file, world.robot)
    assert (loaded.dropped, loaded.left_out) == (fall_set.dropped, fall_set.left_out)
