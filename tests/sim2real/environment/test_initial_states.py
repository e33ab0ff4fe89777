"""Where episodes begin."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.drop import DropSampler
from humanoid_getup.simulation.falls import FallError, sample_falls
from humanoid_getup.simulation.world import World
from robots import load_robot, quaternion
from robots.kinematics import lowest_point, mirror_positions, place
from sim2real.environment import initial_states as starts_module
from sim2real.environment.get_up_env import PHYSICS_STEP, make_get_up
from sim2real.environment.initial_states import (
    LEAST,
    StartPool,
    drop_falls,
    find_arms,
    list_motion_starts,
    sample_stands,
)
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import build_training_world
from sim2real.training.config import RECIPES
from sim2real.training.train import load_pool


def test_what_fails_is_drawn_more_often():
    pool = StartPool.of(np.zeros((4, 1)))
    pool.success[2:] = 1.0
    drawn = pool.draw(20_000, np.random.default_rng(0))
    count = np.bincount(drawn, minlength=4)
    assert count[2:].sum() / count[:2].sum() == pytest.approx(LEAST, rel=0.1)
    assert count[0] == pytest.approx(count[1], rel=0.1)


def test_every_start_is_drawn_alike_while_nothing_is_known():
    pool = StartPool.of(np.zeros((5, 1)))
    drawn = pool.draw(10_000, np.random.default_rng(0))
    assert np.bincount(drawn) == pytest.approx(np.full(5, 2000), rel=0.1)


def test_a_share_of_success_follows_how_episodes_end():
    pool = StartPool.of(np.zeros((3, 1)))
    for _ in range(50):
        pool.note(np.array([0, 1]), np.array([True, False]))
    assert pool.success == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    pool.note(np.array([0]), np.array([False]))
    assert 0.0 < pool.success[0] < 1.0


def test_a_pool_survives_its_file(tmp_path: Path, op3, falls):
    StartPool.of(falls).save(tmp_path / "falls.npz", op3)
    again = StartPool.load(tmp_path / "falls.npz", op3, falls.shape[1])
    assert np.array_equal(again.qpos, falls)
    assert [file.name for file in tmp_path.iterdir()] == ["falls.npz"]


def test_a_pool_of_another_robot_or_of_another_width_is_refused(tmp_path: Path, op3, falls):
    file = tmp_path / "falls.npz"
    StartPool.of(falls).save(file, op3)
    tiny = load_robot("tests/robots/tiny")
    with pytest.raises(ValueError, match=f"it is of robot 'op3', expected '{tiny.name}'"):
        StartPool.load(file, tiny, 27)
    with pytest.raises(ValueError, match=r"qpos has shape \(16, 27\), expected \(any, 28\)"):
        StartPool.load(file, op3, 28)


def test_a_file_that_tells_no_robot_holds_no_starts(tmp_path: Path, op3, falls):
    np.savez(tmp_path / "falls.npz", qpos=falls)
    with pytest.raises(ValueError, match="holds no starts"):
        StartPool.load(tmp_path / "falls.npz", op3, falls.shape[1])


def test_mirroring_a_start_twice_changes_nothing(op3, world, falls):
    twice = mirror_positions(op3, world.model, mirror_positions(op3, world.model, falls))
    assert twice == pytest.approx(falls)
    assert not np.allclose(mirror_positions(op3, world.model, falls), falls)


def test_mirrored_starts_lie_on_the_ground_as_the_others_do(op3, world, falls):
    heights = [lowest_point(world.model, qpos) for qpos in falls]
    mirrored = [
        lowest_point(world.model, qpos) for qpos in mirror_positions(op3, world.model, falls)
    ]
    assert mirrored == pytest.approx(heights, abs=1e-3)  # the head is not quite symmetric
    assert np.all(np.abs(heights) < 0.005)


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


def test_one_seed_makes_one_set_of_falls(world):
    def drop(seed: int, threads: int) -> np.ndarray:
        sim = TrainingSim(world, 4, cycles=6, threads=threads)
        return drop_falls(sim, 6, np.random.default_rng(seed))

    assert np.array_equal(drop(1, 1), drop(1, 2))
    assert not np.array_equal(drop(1, 1), drop(2, 1))


def test_a_robot_that_never_lies_still_is_named(world, monkeypatch):
    monkeypatch.setattr(starts_module, "SETTLED_SPEED", 0.0)
    monkeypatch.setattr(starts_module, "MOST_ROUNDS", 2)
    sim = TrainingSim(world, 2, cycles=6, threads=1)
    told = "robot 'op3' does not come to rest: 0 of 8 falls settled, expected 3"
    with pytest.raises(FallError, match=told):
        drop_falls(sim, 3, np.random.default_rng(0))


def test_frames_of_the_known_motions_are_starts(op3, world):
    starts = list_motion_starts(op3, world.model)
    assert len(starts) > 100
    assert starts.shape[1] == world.model.nq
    root = op3.layout(world.model).root_qpos
    tilt = quaternion.tilt(starts[:, root + 3 : root + 7])
    assert tilt.min() < 0.1
    assert tilt.max() > 1.0


def test_op3s_arms_are_what_no_foot_hangs_on(op3, world):
    arms = {
        name for name, arm in zip(op3.joint_names, find_arms(op3, world.model), strict=True) if arm
    }
    assert arms == {f"{side}_{name}" for side in "lr" for name in ("sho_pitch", "sho_roll", "el")}


def test_stands_have_their_feet_at_home_and_their_arms_anywhere_but_in_the_robot(op3, world):
    stands = sample_stands(op3, world.model, 32, np.random.default_rng(0))
    joints = stands[:, op3.layout(world.model).qpos]
    arms = find_arms(op3, world.model)
    assert np.array_equal(joints[:, ~arms], np.tile(op3.standing.joint_pos[~arms], (32, 1)))
    assert np.ptp(joints[:, arms], axis=0).min() > 1.0
    assert np.all((joints >= op3.lower) & (joints <= op3.upper))
    assert len({tuple(row) for row in joints}) > 25  # where an arm met the body, it is at home
    data = mujoco.MjData(world.model)
    for qpos in stands:
        data.qpos[:] = qpos
        mujoco.mj_forward(world.model, data)
        assert (world.model.geom_bodyid[data.contact.geom] == 0).any(axis=1).all()


def test_who_has_no_arms_stands_as_described():
    tiny = load_robot("tests/robots/tiny")
    model = build_training_world(tiny, FLAT_SCENE, PHYSICS_STEP).model
    stands = sample_stands(tiny, model, 4, np.random.default_rng(0))
    assert np.array_equal(stands, np.tile(place(tiny, model, tiny.standing), (4, 1)))


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
        load_pool(tiny, recipe, seed, tmp_path / f"{seed}.npz")
        make_get_up(1, robot=str(tiny.folder), falls=4, seed=seed, threads=1)
    training = {qpos.tobytes() for qpos in drops}
    assert len(evaluation) >= 4 * 24
    assert len(training) >= 4 * 4
    assert not evaluation & training
