"""What planning costs: generic humanoids, obstacles around them, and the plot."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from path_planning.clutter import sample_lying, sample_obstacles
from path_planning.cost import bench_planner_cost
from path_planning.generic_humanoid import JOINT_COUNTS, make_humanoid
from path_planning.limited_checker import Budget
from path_planning.plot import save_planner_cost

from humanoid_getup.experiments.starts.falls import classify
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import mirror_positions, place, site_positions

PNG = b"\x89PNG"


@pytest.fixture(scope="module", params=JOINT_COUNTS)
def humanoid(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return make_humanoid(request.param, tmp_path_factory.mktemp("humanoid"))


def test_a_humanoid_has_as_many_joints_as_asked_for_and_stands_free(humanoid: Robot):
    assert humanoid.name == f"humanoid_{humanoid.n}"
    world = World(humanoid)
    qpos = place(humanoid, world.model, humanoid.standing)
    assert Clearance(world).measure_self_overlap(qpos) == 0.0
    assert 0.4 < humanoid.standing_neck_height < 0.5


def test_humanoids_differ_in_their_joints_alone(humanoid: Robot, tmp_path: Path):
    model = humanoid.spec().compile()
    other = make_humanoid(JOINT_COUNTS[0], tmp_path).spec().compile()
    assert np.array_equal(model.geom_size, other.geom_size)
    assert model.body_mass == pytest.approx(other.body_mass)
    few = {other.joint(k).name for k in range(other.njnt)}
    assert few <= {model.joint(k).name for k in range(model.njnt)}


def test_left_and_right_of_a_humanoid_are_mirror_images(humanoid: Robot):
    world = World(humanoid)
    posture = sample_lying(world, "left", np.random.default_rng(1))
    qpos = place(humanoid, world.model, posture)
    mirrored = mirror_positions(humanoid, world.model, qpos)
    rows = np.array([qpos, mirrored])
    left, right = (site_positions(world.model, rows, site)[:, 2] for site in ("l_sole", "r_sole"))
    assert left == pytest.approx(right[::-1])


def test_a_sampled_posture_lies_free_on_the_ground(humanoid: Robot):
    world, rng = World(humanoid), np.random.default_rng(2)
    for start_class in ("supine", "prone", "left", "right"):
        posture = sample_lying(world, start_class, rng)
        assert classify(posture.orientation) == start_class
        qpos = place(humanoid, world.model, posture)
        assert Clearance(world).measure_self_overlap(qpos) == 0.0
        assert Clearance(world).measure_overlap(qpos) < 1e-9


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


@pytest.mark.slow
def test_the_cost_is_measured_with_every_number_of_joints_and_obstacles(tmp_path: Path):
    seen = []
    options = {"seed": 0, "each": 2, "joints": (20, 49), "obstacles": (0, 8)}
    budget = Budget(checks=3000)
    result = bench_planner_cost(**options, budget=budget, report=seen.append)
    again = bench_planner_cost(**options, budget=budget)
    assert list(result["cases"]) == [
        "20 joints, 0 obstacles",
        "20 joints, 8 obstacles",
        "49 joints, 0 obstacles",
        "49 joints, 8 obstacles",
    ]
    assert seen == result["problems"]
    for record, same in zip(seen, again["problems"], strict=True):
        assert (record["found"], record["checks"]) == (same["found"], same["checks"]), record
        assert record["check_over_bare"] == pytest.approx(record["check_us"] / record["bare_us"])
    assert all(case["n"] == 2 for case in result["cases"].values())
    save_planner_cost(result, tmp_path / "cost.png")
    assert (tmp_path / "cost.png").read_bytes().startswith(PNG)


def test_there_must_be_space_for_the_obstacles(op3: Robot, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("path_planning.clutter.REACH", 0.05)  # all in the torso
    with pytest.raises(ValueError, match=r"found space for 0 obstacles, expected 2"):
        sample_obstacles(op3, [op3.standing], 2, np.random.default_rng(0))
