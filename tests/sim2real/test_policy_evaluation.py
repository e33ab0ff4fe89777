"""Evaluation: where physics goes wrong, nobody stands."""

import numpy as np

from robots.kinematics import place
from sim2real.environment.training_simulation import TrainingSim
from sim2real.policy_evaluation import roll_out_policy


def test_who_diverged_never_stood_and_the_others_did(op3, action, world, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    sim = TrainingSim(world, 3, cycles=action.cycles, threads=1)
    starts = np.tile(place(op3, world.model, op3.standing), (3, 1))

    def hit(step: int) -> None:
        if step == 2:
            sim.push(np.array([1]), np.full((1, 3), np.nan))

    def idle(observations: np.ndarray) -> np.ndarray:
        return np.zeros((len(observations), action.size))

    rises = roll_out_policy(sim, action, idle, starts, duration=3.5, on_step=hit)
    assert rises.stood.tolist() == [True, False, True]
    assert not rises.upright[1].any()
    assert rises.upright[[0, 2]].all()
    assert np.isfinite(rises.qpos[[0, 2]]).all()
