"""Evaluation of policies: a stand lasts three seconds, and diverged physics is no stand."""

import numpy as np
import pytest

from robots.kinematics import place
from sim2real.environment.training_simulation import TrainingSim
from sim2real.policy_evaluation import PolicyRollouts, roll_out_policy


def test_a_robot_that_diverged_never_stood_and_the_others_did(
    op3, action, world, tmp_path, monkeypatch
):
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


def test_a_policy_stood_only_if_the_last_three_seconds_are_one_stand():
    period, samples = 0.01, 500
    upright = np.zeros((5, samples), dtype=bool)
    upright[0, -1:] = True  # the last sample alone
    upright[1, -300:] = True  # 300 samples span 299 periods, 2.99 s
    upright[2, -301:] = True  # 3.0 s
    upright[3, 10:-1] = True  # fell in the end
    upright[4, 10:] = True
    upright[4, -100] = False  # swayed in between
    rollouts = PolicyRollouts(
        period=period,
        upright=upright,
        qpos=np.zeros((5, 1, 9)),
        torque=np.ones((5, samples, 2)),
        joint_vel=np.ones((5, samples, 2)),
        head_impact=np.zeros(5),
    )
    assert rollouts.stood.tolist() == [False, False, True, False, False]
    assert rollouts.stand_time[2] == pytest.approx(2.0)  # sample 199 ends the 200th period
    for figure in (rollouts.stand_time, rollouts.rms_torque(), rollouts.standing_speed()):
        assert np.isfinite(figure).tolist() == [False, False, True, False, False]
