"""Where episodes begin: frames of motions, settled falls, and stands, drawn from a pool."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from pathlib import Path

from humanoid_getup.experiments.drop import DropSampler
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.body.parts import find_arm_joints
from sim2real.environment.get_up_factory import make_get_up
from sim2real.environment.starts import (
    LEAST,
    StartPool,
    make_backward_pool,
    sample_stands,
)
from sim2real.environment.training_simulation import TrainingSim
from sim2real.training.config import RECIPES
from sim2real.training.train import Training


def test_falls_lie_still_within_their_limits(op3, world, falls):
    sim = TrainingSim(world, len(falls), cycles=6, threads=1)
    sim.place(np.arange(len(falls)), falls)
    target = falls[:, op3.layout(world.model).qpos]
    before = sim.measure_privileged_state().height
    for _ in range(4):
        sim.follow(target, target)
    after = sim.measure_privileged_state()
    assert after.height == pytest.approx(before, abs=0.07)
    assert np.all(after.non_foot_contact)
    slack = 0.05  # limits are soft
    assert np.all((target > op3.lower - slack) & (target < op3.upper + slack))


@pytest.fixture
def drops(monkeypatch) -> list[np.ndarray]:
    """Record where robots are dropped from, by whichever function drops them."""
    recorded: list[np.ndarray] = []
    sample = DropSampler.sample

    def record(self: DropSampler, rng: np.random.Generator) -> np.ndarray:
        recorded.append(sample(self, rng))
        return recorded[-1]

    monkeypatch.setattr(DropSampler, "sample", record)
    return recorded


def test_training_and_evaluation_never_draw_the_same_fall(drops, tiny, tmp_path):
    """Through the functions that draw them, for every pair of some seeds."""
    world = World(tiny)
    for seed in range(4):
        sample_falls(world, {"supine": 1}, np.random.default_rng(seed))
    evaluation = {qpos.tobytes() for qpos in drops}
    drops.clear()
    recipe = replace(RECIPES["quick"], falls=4)
    for seed in range(4):
        (folder := tmp_path / str(seed)).mkdir()
        Training(robot=tiny, recipe=recipe, seed=seed, folder=folder).load_pool()
        make_get_up(1, robot=str(tiny.folder), falls=4, seed=seed, threads=1)
    training = {qpos.tobytes() for qpos in drops}
    assert len(evaluation) >= 4 * 24
    assert len(training) >= 4 * 4
    assert not evaluation & training


def test_stands_have_their_feet_at_home_and_their_arms_anywhere_but_in_the_robot(op3, world):
    stands = sample_stands(op3, world.model, 32, np.random.default_rng(0))
    joints = stands[:, op3.layout(world.model).qpos]
    arms = find_arm_joints(op3, world.model)
    assert np.array_equal(joints[:, ~arms], np.tile(op3.standing.joint_pos[~arms], (32, 1)))
    assert np.ptp(joints[:, arms], axis=0).min() > 1.0
    assert np.all((joints >= op3.lower) & (joints <= op3.upper))
    assert len({tuple(row) for row in joints}) > 25  # where an arm met the body, it is at home
    data = mujoco.MjData(world.model)
    for qpos in stands:
        data.qpos[:] = qpos
        mujoco.mj_forward(world.model, data)
        assert (world.model.geom_bodyid[data.contact.geom] == 0).any(axis=1).all()


def test_what_fails_is_drawn_more_often():
    pool = StartPool.of(np.zeros((4, 1)))
    pool.success[2:] = 1.0
    drawn = pool.draw(20_000, np.random.default_rng(0))
    count = np.bincount(drawn, minlength=4)
    assert count[2:].sum() / count[:2].sum() == pytest.approx(LEAST, rel=0.1)
    assert count[0] == pytest.approx(count[1], rel=0.1)


def test_levels_that_are_open_are_drawn_alike_however_hard_they_are():
    pool = StartPool.of(np.zeros((44, 7)), np.repeat([0, 1, 2], [4, 36, 4]))
    pool.success[:22] = 1.0  # all of level 0, half of level 1
    drawn = pool.draw(4000, np.random.default_rng(0), 1)
    assert drawn.max() < 40, "level 2 is not open"
    assert np.mean(drawn < 4) == pytest.approx(0.5, abs=0.04)
    assert np.mean(drawn >= 22) == pytest.approx(0.5 / 1.15, abs=0.04)


def test_a_pool_of_another_robot_or_of_another_width_is_refused(tmp_path: Path, op3, falls):
    file = tmp_path / "falls.npz"
    StartPool.of(falls).save(file, op3)
    tiny = load_robot("tests/robots/tiny")
    with pytest.raises(ValueError, match=f"it is of robot 'op3', expected '{tiny.name}'"):
        StartPool.load(file, tiny, 27)
    with pytest.raises(ValueError, match=r"qpos has shape \(16, 27\), expected \(any, 28\)"):
        StartPool.load(file, op3, 28)


def test_a_pool_along_rises_survives_its_file_and_knows_its_falls(tmp_path: Path, op3, world):
    pool = make_backward_pool(world, 2, np.random.default_rng(0))
    pool.save(tmp_path / "falls.npz", op3)
    again = StartPool.load(tmp_path / "falls.npz", op3, world.model.nq)
    assert [file.name for file in tmp_path.iterdir()] == ["falls.npz"]
    assert np.array_equal(again.qpos, pool.qpos)
    assert np.array_equal(again.level, pool.level)
    assert again.fallen.sum() == 4  # two, and their mirror images
    assert again.level[again.fallen].tolist() == [again.level.max()] * 4
    assert again.level[~again.fallen].max() == again.level.max() - 1
