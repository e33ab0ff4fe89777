"""Steps are collected while the networks learn, by networks as they were before."""

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")
pytest.importorskip("tensorboard")

from humanoid_getup.policy.action import ActionSpec
from robots import Robot
from sim2real.environment.env_options import EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts import StartPool
from sim2real.training.config import RECIPES, STEPS
from sim2real.training.distributed import DistributedProcess
from sim2real.training.overlapped_runner import MOST_WEIGHT, OverlappedRunner, weigh_by_newest
from sim2real.training.ppo import AveragingPPO
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.runner import build_config

RECIPE = replace(RECIPES["quick"], hidden=(8, 8), overlap=True)
ROBOTS = 4
ENDS = 60.0  # s after which a wait has failed


@pytest.fixture
def runner(op3: Robot, action: ActionSpec, pool: StartPool, tmp_path: Path) -> OverlappedRunner:
    env = RslEnv(GetUpEnv(op3, action, pool, EnvOptions(robots=ROBOTS, threads=1)))
    env.begin(0, np.random.default_rng(0))
    torch.manual_seed(0)
    config = build_config(RECIPE, 0)
    made = OverlappedRunner(env, config, tmp_path, "cpu", DistributedProcess())
    made.alg.train_mode()
    return made


def flatten(network):
    return torch.cat([value.flatten().float() for value in network.state_dict().values()]).clone()


def test_steps_are_collected_while_the_networks_learn(runner, monkeypatch):
    steps, ahead = [], threading.Event()
    step, update = RslEnv.step, AveragingPPO.update
    in_time = []

    def count(self, actions):
        steps.append(threading.current_thread())
        if len(steps) > 2 * STEPS:  # of the third iteration; the first one ends in a checkpoint
            ahead.set()
        return step(self, actions)

    def wait(self):
        if len(in_time) == 1:  # the second update, which has not ended while it waits
            in_time.append(ahead.wait(ENDS))
        else:
            in_time.append(True)
        return update(self)

    monkeypatch.setattr(RslEnv, "step", count)
    monkeypatch.setattr(AveragingPPO, "update", wait)
    runner.learn(3)
    assert in_time == [True] * 3
    assert len(steps) == 3 * STEPS
    assert threading.main_thread() not in steps


def test_the_collector_keeps_its_networks_while_others_learn(runner):
    collector, alg = runner._collector, runner.alg
    collector.copy_networks(alg)
    before = flatten(alg.actor), flatten(alg.critic)
    collector.collect(0)
    collector.hand_over(alg)
    alg.update()
    kept = collector._alg.actor, collector._alg.critic
    for network, learned, held in zip((alg.actor, alg.critic), kept, before, strict=True):
        assert not torch.equal(flatten(network), held)
        assert torch.equal(flatten(learned), held)
    assert int(alg.actor.obs_normalizer.count) == STEPS * ROBOTS
    assert int(kept[0].obs_normalizer.count) == 0
    collector.copy_networks(alg)
    assert torch.equal(flatten(kept[0]), flatten(alg.actor))


def test_steps_of_an_older_policy_are_weighted_by_the_newest(runner):
    collector, alg = runner._collector, runner.alg
    collector.collect(0)
    collector.hand_over(alg)
    stored = alg.storage
    seen = stored.observations["policy"]
    old_mean, old_std = (values.clone() for values in stored.distribution_params)
    advantages = stored.advantages.clone()
    with torch.no_grad():  # another policy
        alg.actor.mlp[4].bias += 0.3
        alg.actor.distribution.log_std_param += 0.1
    weigh_by_newest(alg)
    mean = alg.actor.mlp(alg.actor.obs_normalizer(seen)).detach()
    std = old_std * np.exp(0.1)

    def log_density(mean, std):
        return -(0.5 * ((stored.actions - mean) / std).square() + std.log()).sum(-1, keepdim=True)

    ratio = (log_density(mean, std) - log_density(old_mean, old_std)).exp()
    expected = advantages * ratio.clamp(max=MOST_WEIGHT)
    assert torch.allclose(stored.advantages, expected, rtol=1e-3, atol=1e-5)
    assert ratio.max() > MOST_WEIGHT > 1.0 > ratio.min()
    assert torch.allclose(stored.distribution_params[0], mean, atol=1e-5)
    assert torch.allclose(stored.distribution_params[1], std.expand_as(mean), atol=1e-5)
    again = stored.advantages.clone()
    weigh_by_newest(alg)  # the newest policy has already weighted them
    assert torch.allclose(stored.advantages, again, atol=1e-6)


def test_a_fault_while_collecting_ends_the_training(runner, monkeypatch):
    def fail(*_: object) -> None:
        raise ArithmeticError("the simulation diverged")

    monkeypatch.setattr(RslEnv, "step", fail)
    with pytest.raises(ArithmeticError, match="diverged"):
        runner.learn(2)
