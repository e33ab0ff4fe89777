"""Start states of others: converted once, exact, and settled where a rise begins."""

import numpy as np
import pytest
from small_repository import SMALL

from humanoid_getup.benchmarks.bodies.body_starts import BodyStarts
from humanoid_getup.simulation.world import World
from robots import load_robot


@pytest.fixture(scope="module")
def converted(repository) -> BodyStarts:
    return BodyStarts.convert("small", SMALL.find_starts(repository.folder), repository.model)


def test_conversion_keeps_every_number_under_its_joint(repository, converted):
    qpos = repository.pickle_starts(5)
    assert len(converted) == 5
    assert converted.position.tolist() == qpos[:, :3].tolist()
    assert converted.orientation == pytest.approx(qpos[:, 3:7])
    for joint in range(1, repository.model.njnt):
        column = converted.joints.index(repository.model.joint(joint).name)
        address = repository.model.jnt_qposadr[joint]
        assert converted.joint_pos[:, column].tolist() == qpos[:, address].tolist()


def test_a_file_of_starts_gives_them_back(converted, tmp_path):
    converted.save(tmp_path / "starts.npz")
    again = BodyStarts.load(tmp_path / "starts.npz")
    assert (again.body, again.source_sha256) == ("small", converted.source_sha256)
    assert again.joints == converted.joints
    assert again.position.tolist() == converted.position.tolist()
    assert again.orientation.tolist() == converted.orientation.tolist()
    assert again.joint_pos.tolist() == converted.joint_pos.tolist()


def test_starts_of_another_model_are_refused(repository, op3):
    path, model = SMALL.find_starts(repository.folder), op3.spec().compile()
    with pytest.raises(ValueError, match=f"start 0 has 26 positions, expected {model.nq}"):
        BodyStarts.convert("small", path, model)


def test_drawn_starts_lie_at_rest_within_the_ranges_and_depend_on_the_seed(repository, converted):
    world = World(load_robot(repository.robots / "small"))
    falls = converted.sample(world, 2, seed=1)
    robot = world.robot
    for fall in falls:
        angles = fall.posture.joint_pos
        assert np.all((robot.lower - 0.05 < angles) & (angles < robot.upper + 0.05))
        assert fall.posture.position[2] < 0.2
    again = converted.sample(world, 2, seed=1)
    assert [f.posture.joint_pos.tolist() for f in again] == [
        f.posture.joint_pos.tolist() for f in falls
    ]
    assert len(converted.sample(world, 9, seed=2)) == len(converted)


def test_a_robot_with_a_joint_that_the_starts_lack_is_refused(converted, world):
    with pytest.raises(ValueError, match="have no joint r_sho_pitch, and 19 others, expected"):
        converted.sample(world, 1, seed=0)
