"""The runner fits a critic to a policy that is taken over."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from humanoid_getup.policy.action import ActionSpec
from robots import Robot
from sim2real.environment.env_options import EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts.start_pool import StartPool
from sim2real.training import runner as runner_module
from sim2real.training.config import RECIPES
from sim2real.training.distributed import DistributedProcess
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.runner import TrainingRunner, build_config

RECIPE = replace(next(iter(RECIPES.values())), hidden=(8, 8))
STEPS = 4


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner_module, "STEPS", STEPS)
    monkeypatch.setattr(runner_module, "CRITIC_ROUNDS", 3)


@pytest.fixture
def make(op3: Robot, action: ActionSpec, pool: StartPool, tmp_path: Path):
    def make_runner() -> TrainingRunner:
        env = RslEnv(GetUpEnv(op3, action, pool, EnvOptions(robots=4, threads=1)))
        env.begin(0, np.random.default_rng(0))
        torch.manual_seed(0)
        config = build_config(RECIPE, 0)
        return TrainingRunner(env, config, tmp_path, "cpu", DistributedProcess())

    return make_runner


def flatten(state: dict) -> "torch.Tensor":
    return torch.cat([value.flatten().float() for value in state.values()]).clone()


def test_fitting_the_critic_leaves_the_policy_and_its_statistics_alone(make):
    runner = make()
    actor, critic = runner.alg.actor, runner.alg.critic
    runner.alg.actor.update_normalization(runner.env.get_observations())
    before = flatten(actor.state_dict()), flatten(critic.state_dict())
    errors = runner.fit_critic(0)
    assert len(errors) == 3
    assert np.all(np.isfinite(errors))
    assert torch.equal(flatten(actor.state_dict()), before[0])
    assert not torch.equal(flatten(critic.state_dict()), before[1])
    assert runner.env.reports
