"""What planning costs: generic humanoids, obstacles around them, and the plot."""

import mujoco
import numpy as np
import pytest
from path_planning.clutter import sample_lying, sample_obstacles
from path_planning.generic_humanoid import JOINT_COUNTS, make_humanoid

from humanoid_getup.experiments.starts.falls import classify
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import mirror_positions, place, site_positions


@pytest.fixture(scope="module", params=JOINT_COUNTS)
def humanoid(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return make_humanoid(request.param, tmp_path_factory.mktemp("humanoid"))


def test_a_humanoid_is_symmetric_has_its_joints_and_stands_or_lies_free(humanoid: Robot):
    assert humanoid.name == f"humanoid_{humanoid.n}"
    world, rng = World(humanoid), np.random.default_rng(2)
    clearance = Clearance(world)
    qpos = place(humanoid, world.model, humanoid.standing)
    assert clearance.measure_self_overlap(qpos) == 0.0
    assert 0.4 < humanoid.standing_neck_height < 0.5
    for start_class in ("supine", "prone", "left", "right"):
        posture = sample_lying(world, start_class, rng)
        assert classify(posture.orientation) == start_class
        qpos = place(humanoid, world.model, posture)
        assert clearance.measure_self_overlap(qpos) == 0.0
        assert clearance.measure_overlap(qpos) < 1e-9
    rows = np.array([qpos, mirror_positions(humanoid, world.model, qpos)])
    left, right = (site_positions(world.model, rows, site)[:, 2] for site in ("l_sole", "r_sole"))
    assert left == pytest.approx(right[::-1])


def test_obstacles_touch_none_of_the_postures_that_stay_free(humanoid: Robot):
    rng = np.random.default_rng(3)
    posture = sample_lying(World(humanoid), "prone", rng)
    obstacles = sample_obstacles(humanoid, [posture], 30, rng)
    assert {obstacle.kind for obstacle in obstacles} == {"box", "capsule"}
    model = Scene(name="clutter", obstacles=obstacles).compile(humanoid)
    data = mujoco.MjData(model)
    data.qpos[:] = place(humanoid, model, posture)
    mujoco.mj_forward(model, data)
    touched = {model.geom(geom).name for geom in data.contact.geom.ravel()}
    assert len(obstacles) == 30
    assert touched.isdisjoint(obstacle.name for obstacle in obstacles)


def test_there_must_be_space_for_the_obstacles(op3: Robot, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("path_planning.clutter.REACH", 0.05)  # all in the torso
    with pytest.raises(ValueError, match=r"found space for 0 obstacles, expected 2"):
        sample_obstacles(op3, [op3.standing], 2, np.random.default_rng(0))
