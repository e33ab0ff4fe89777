"""Where episodes begin: frames of motions, settled falls, and stands."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.experiments.starts.drop import DropSampler
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.body.parts import find_arm_joints
from robots.kinematics import mirror_positions
from sim2real.environment.get_up_factory import make_get_up
from sim2real.environment.physics.training_simulation import TrainingSim
from sim2real.environment.starts.start_states import (
    LEVELS,
    list_backward_starts,
    list_motion_starts,
    sample_stands,
)
from sim2real.training.config import RECIPES
from sim2real.training.train import load_pool


def test_frames_of_the_known_motions_are_starts(op3, world):
    starts = list_motion_starts(op3, world.model)
    assert len(starts) > 100
    assert starts.shape[1] == world.model.nq
    root = op3.layout(world.model).root_qpos
    tilt = quaternion.tilt(starts[:, root + 3 : root + 7])
    assert tilt.min() < 0.1
    assert tilt.max() > 1.0


def test_backward_starts_are_higher_the_nearer_they_are_to_the_stand(op3, world):
    starts, levels = list_backward_starts(op3, world.model)
    assert sorted(set(levels.tolist())) == list(range(LEVELS))
    height = starts[:, op3.layout(world.model).root_qpos + 2]
    mean = [height[levels == level].mean() for level in range(LEVELS)]
    assert mean[:3] == sorted(mean[:3], reverse=True)
    assert mean[0] > 0.9 * op3.standing.position[2]
    assert mean[-1] < 0.5 * mean[0]
    count = len(starts) // 2
    assert starts[count:] == pytest.approx(mirror_positions(op3, world.model, starts[:count]))


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
        load_pool(tiny, recipe, seed, tmp_path / f"{seed}.npz")
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
