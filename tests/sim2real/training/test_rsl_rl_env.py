"""The adapter to rsl-rl: observations by group, ends of episodes, and mirror images."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from humanoid_getup.policy.action import ActionSpec
from robots import Robot
from sim2real.environment.env_options import EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts.start_pool import StartPool
from sim2real.training.rsl_rl_env import RslEnv, mirror_batch

ROBOTS = 4


@pytest.fixture
def wrapped(op3: Robot, action: ActionSpec, pool: StartPool) -> GetUpEnv:
    return GetUpEnv(op3, action, StartPool.of(pool.qpos), EnvOptions(robots=ROBOTS, threads=1))


@pytest.fixture
def env(wrapped: GetUpEnv) -> RslEnv:
    env = RslEnv(wrapped)
    env.begin(0, np.random.default_rng(0))
    return env


def test_episodes_begin_at_different_ages(env: RslEnv):
    ages = env.episode_length_buf.tolist()
    assert len(set(ages)) > 1
    assert all(0 <= age < env.max_episode_length for age in ages)
    env.episode_length_buf = torch.tensor([1, 2, 3, 4])
    assert env.env.episodes.age.tolist() == [1, 2, 3, 4]


def test_the_mean_reward_of_each_step_is_reported_unless_that_is_off(wrapped: GetUpEnv):
    seen = []
    env = RslEnv(wrapped, on_step=lambda reward, info: seen.append((reward, info)))
    env.begin(0, np.random.default_rng(0))
    _, rewards, _, _ = env.step(torch.zeros(ROBOTS, env.num_actions))
    env.reports = False
    env.step(torch.zeros(ROBOTS, env.num_actions))
    ((reward, info),) = seen
    assert reward == pytest.approx(float(rewards.mean()))
    assert "rewards" in info


def test_symmetry_appends_the_mirror_images(env: RslEnv, action: ActionSpec):
    actions = torch.ones(4, action.size)
    both, doubled = mirror_batch(env, env.get_observations(), actions)
    assert both is not None
    assert doubled is not None
    assert both.batch_size[0] == 8
    assert torch.equal(both["policy"][:4], env.observations["policy"])
    again, _ = mirror_batch(env, both[4:], None)
    assert again is not None
    assert torch.equal(again["policy"][4:], env.observations["policy"])
    assert torch.equal(again["critic"][4:], env.observations["critic"])
    assert doubled[4:, : action.size // 2].eq(1.0).all()
    assert doubled[4:, action.size // 2 :].eq(-1.0).all()
    assert mirror_batch(env) == (None, None)
