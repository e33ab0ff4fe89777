"""Robots come to lie on every side; sets of falls are stored as they are."""

from pathlib import Path

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import (
    CLASSES,
    Fall,
    FallSet,
    classify,
    sample_fall_set,
    sample_falls,
)
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots import Posture, Robot, quaternion
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


def make_falls(robot: Robot, kinds: tuple[str, ...]) -> FallSet:
    rng = np.random.default_rng(0)
    falls = [
        Fall(
            posture=Posture(
                position=rng.normal(size=3),
                orientation=np.array([0.6, 0.8, 0.0, 0.0]),
                joint_pos=rng.uniform(robot.lower, robot.upper),
            ),
            start_class=kind,
        )
        for kind in kinds
    ]
    return FallSet(robot=robot.name, scene="flat", seed=7, falls=tuple(falls))


def test_falls_come_back_as_they_were_written(op3: Robot, tmp_path: Path):
    written = make_falls(op3, ("prone", "left"))
    written.save(tmp_path / "new" / "falls.npz")
    read = FallSet.load(tmp_path / "new" / "falls.npz", op3)
    assert (read.robot, read.scene, read.seed) == ("op3", "flat", 7)
    assert [fall.start_class for fall in read.falls] == ["prone", "left"]
    for fall, other in zip(read.falls, written.falls, strict=True):
        assert np.array_equal(fall.posture.joint_pos, other.posture.joint_pos)
        assert np.array_equal(fall.posture.orientation, other.posture.orientation)
        assert np.array_equal(fall.posture.position, other.posture.position)


def test_as_many_of_every_class_are_chosen_or_none(op3: Robot):
    falls = make_falls(op3, (*CLASSES, *CLASSES, "prone"))
    chosen = falls.choose(2)
    assert [fall.start_class for fall in chosen.falls] == [k for k in CLASSES for _ in range(2)]
    with pytest.raises(ValueError, match="has 2 supine, 2 left, 2 right, expected 3 of each"):
        falls.choose(3)


def spoil(file: Path, **changes: object) -> None:
    with np.load(file) as stored:
        arrays = dict(stored) | changes
    np.savez(file, **{key: value for key, value in arrays.items() if value is not None})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": None}, "key 'position' is missing"),
        ({"extra": 1}, "unknown key 'extra'"),
        ({"robot": "pepper"}, "it is of robot 'pepper', expected 'op3'"),
        ({"seed": 0.5}, "seed is not an integer"),
        ({"joint_pos": np.full((2, 20), 50.0)}, "fall 0: joint 'r_sho_pitch' is .50.000 rad"),
        ({"position": np.full((2, 3), 1e200)}, "fall 0: position is more than 1000 m"),
        ({"position": np.zeros((2, 2))}, r"position has shape \(2, 2\), expected \(2, 3\)"),
        ({"joint_pos": np.full((2, 20), np.nan)}, "joint_pos holds nan, expected finite"),
        ({"orientation": np.ones((2, 4))}, "orientation has length 2.0000, expected 1"),
        ({"start_class": np.array(["prone", "asleep"])}, "start_class is not a list of supine"),
        ({"scene": np.array([{}], dtype=object)}, "scene has type object"),
    ],
)
def test_a_damaged_set_is_refused_in_one_line(op3: Robot, tmp_path: Path, changes, message):
    file = tmp_path / "falls.npz"
    make_falls(op3, ("prone", "left")).save(file)
    spoil(file, **changes)
    with pytest.raises(ValueError, match=message) as refusal:
        FallSet.load(file, op3)
    assert str(refusal.value).startswith(f"falls {file}: ")
    assert str(refusal.value).isprintable()
