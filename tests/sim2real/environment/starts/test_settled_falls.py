"""Falls that episodes begin with."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.experiments.starts.drop import DropSampler
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.simulation.world import World
from robots.kinematics import mirror_positions
from sim2real.environment.get_up_factory import make_get_up
from sim2real.environment.physics.training_simulation import TrainingSim
from sim2real.training.config import RECIPES
from sim2real.training.train import load_pool


def test_mirroring_a_start_twice_changes_nothing(op3, world, falls):
    twice = mirror_positions(op3, world.model, mirror_positions(op3, world.model, falls))
    assert twice == pytest.approx(falls)
    assert not np.allclose(mirror_positions(op3, world.model, falls), falls)


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
