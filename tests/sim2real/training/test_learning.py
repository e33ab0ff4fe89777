"""The adapter to rsl-rl, its runner, a symmetric network, and PPO's average of actors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from copy import deepcopy

from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage
from tensordict import TensorDict

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import Mirror
from robots import Robot
from sim2real.environment.env_options import EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts import StartPool
from sim2real.training import runner as runner_module
from sim2real.training.config import RECIPES
from sim2real.training.networks import SymmetricModel
from sim2real.training.ppo import AVERAGE, UPDATES, AveragingPPO
from sim2real.training.rsl_rl_env import RslEnv, mirror_batch
from sim2real.training.runner import TrainingRunner, build_config

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


def flatten(state: dict) -> "torch.Tensor":
    return torch.cat([value.flatten().float() for value in state.values()]).clone()


def test_fitting_the_critic_leaves_the_policy_and_its_statistics_alone(
    env: RslEnv, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(runner_module, "STEPS", 4)
    monkeypatch.setattr(runner_module, "CRITIC_ROUNDS", 3)
    torch.manual_seed(0)
    config = build_config(replace(RECIPES["quick"], hidden=(8, 8)), 0)
    runner = TrainingRunner(env, config, tmp_path, "cpu")
    actor, critic = runner.alg.actor, runner.alg.critic
    runner.alg.actor.update_normalization(runner.env.get_observations())
    before = flatten(actor.state_dict()), flatten(critic.state_dict())
    errors = runner.fit_critic(0)
    assert len(errors) == 3
    assert np.all(np.isfinite(errors))
    assert torch.equal(flatten(actor.state_dict()), before[0])
    assert not torch.equal(flatten(critic.state_dict()), before[1])
    assert runner.env.reports


STEPS, INPUTS, OUTPUTS = 8, 3, 2
GAUSSIAN = {"class_name": "GaussianDistribution", "init_std": 1.0, "std_type": "log"}


def mirror(env=None, obs=None, actions=None):
    """Change every sign in the mirror images."""
    del env
    return (
        None if obs is None else torch.cat([obs, TensorDict({"policy": -obs["policy"]}, len(obs))]),
        None if actions is None else torch.cat([actions, -actions]),
    )


def make_ppo(seed: int = 0) -> AveragingPPO:
    torch.manual_seed(seed)
    seen = observe(seed)
    nets = [
        MLPModel(seen, {name: ["policy"]}, name, size, hidden_dims=[4], **more)
        for name, size, more in (
            ("actor", OUTPUTS, {"distribution_cfg": GAUSSIAN}),
            ("critic", 1, {}),
        )
    ]
    storage = RolloutStorage("rl", ROBOTS, STEPS, seen, [OUTPUTS])
    symmetry = {"env": None, "data_augmentation_func": mirror, "use_data_augmentation": True}
    return AveragingPPO(*nets, storage, num_learning_epochs=1, symmetry_cfg=symmetry)


def observe(seed: int) -> TensorDict:
    values = torch.randn(ROBOTS, INPUTS, generator=torch.Generator().manual_seed(seed))
    return TensorDict({"policy": values}, batch_size=[ROBOTS])


def learn(made: AveragingPPO, seed: int) -> dict[str, float]:
    """Collect steps that are rewarded for their number, and learn from them."""
    with torch.inference_mode():
        for step in range(STEPS):
            made.act(observe(seed + step))
            done = torch.zeros(ROBOTS, dtype=torch.bool)
            made.process_env_step(
                observe(seed + step), torch.full((ROBOTS,), float(step)), done, {}
            )
        made.compute_returns(observe(seed))
    return made.update()


def weights(actor) -> torch.Tensor:
    return torch.cat([value.flatten() for value in actor.parameters()]).detach().clone()


def test_the_first_updates_count_alike_in_the_average():
    made, seen = make_ppo(), []
    for update in range(4):
        losses = learn(made, 10 * update)
        seen.append(weights(made.actor))
        assert "symmetry" not in losses
    assert not torch.allclose(seen[0], seen[-1])
    expected = torch.stack(seen).mean(dim=0)
    assert torch.allclose(weights(made.average.module), expected, atol=1e-6)


def test_a_saved_training_continues_with_its_average():
    made, other = make_ppo(), make_ppo(seed=1)
    learn(made, 0)
    learn(made, 10)
    state = deepcopy(made.save())
    assert state[UPDATES] == 2
    other.load(state, None, True)
    assert torch.equal(weights(other.average.module), weights(made.average.module))
    for each in (made, other):
        torch.manual_seed(5)
        learn(each, 20)
    assert torch.equal(weights(other.average.module), weights(made.average.module))


def test_an_actor_that_is_taken_over_begins_its_own_average():
    made, other = make_ppo(), make_ppo(seed=1)
    learn(made, 0)
    learn(made, 10)
    assert not torch.equal(weights(made.actor), weights(made.average.module))
    other.load(made.save(), {"actor": True, "critic": True}, True)
    assert torch.equal(weights(other.average.module), weights(made.actor))
    assert int(other.average.n_averaged) == 0
    assert AVERAGE in other.save()


INPUT_MIRROR = Mirror(np.array([1, 0, 2, 3]), np.array([1.0, 1.0, -1.0, 1.0]))
OUTPUT_MIRROR = Mirror(np.array([1, 0]), np.array([-1.0, -1.0]))


def make_model(inputs: Mirror = INPUT_MIRROR) -> SymmetricModel:
    torch.manual_seed(0)
    return SymmetricModel(
        pack(torch.zeros(1, len(inputs.index))),
        {"actor": ["policy"]},
        "actor",
        2,
        hidden_dims=[8, 8],
        obs_normalization=True,
        inputs=inputs,
        outputs=OUTPUT_MIRROR,
    )


def pack(values) -> TensorDict:
    return TensorDict({"policy": values}, batch_size=[len(values)])


def exchange_sides(values, exchange: Mirror):
    return values[:, torch.as_tensor(exchange.index)] * torch.tensor(exchange.sign).float()


def test_mirrored_observations_have_mirrored_outputs():
    model, seen = make_model(), torch.randn(30, 4) * torch.tensor([1.0, 3.0, 2.0, 5.0]) + 1.0
    model.update_normalization(pack(seen))
    outputs = model(pack(seen))
    assert torch.allclose(
        model(pack(exchange_sides(seen, INPUT_MIRROR))),
        exchange_sides(outputs, OUTPUT_MIRROR),
        atol=1e-6,
    )
    assert float((outputs - exchange_sides(outputs, OUTPUT_MIRROR)).detach().abs().max()) > 0.01
    exported = model.as_onnx(verbose=False)
    assert torch.allclose(exported(seen), outputs, atol=1e-6)
