"""Action-space extension: new components change nothing at first."""

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from humanoid_getup.policy.action import ActionSpec, choose_actions
from humanoid_getup.policy.observation import list_terms
from robots import Robot
from sim2real.training.config import RECIPES
from sim2real.training.networks.extension import FIRST_STD, extend_actions
from sim2real.training.runner import build_config


def make(size: int, outputs: int, which: str) -> MLPModel:
    config = dict(build_config(RECIPES["quick"], 0)[which])
    config.pop("class_name")
    config["hidden_dims"] = [16, 8]
    blank = TensorDict({"policy": torch.zeros(1, size)}, batch_size=[1])
    return MLPModel(blank, {which: ["policy"]}, which, outputs, **config)


def size_of(robot: Robot, action: ActionSpec) -> int:
    return sum(term.size for term in list_terms(robot, action))


def test_a_extended_policy_does_what_it_did_before(op3: Robot, action: ActionSpec):
    narrow = choose_actions(op3, wide=False)
    k, more = narrow.size, action.size - narrow.size
    few, many = size_of(op3, narrow), size_of(op3, action)
    torch.manual_seed(0)
    actor, critic = make(few, k, "actor"), make(few + 5, 1, "critic")
    for model, size in ((actor, few), (critic, few + 5)):
        model.train()
        seen = TensorDict({"policy": 1.0 + 2.0 * torch.randn(64, size)}, batch_size=[64])
        model.update_normalization(seen)
        model.eval()
    state = {"actor_state_dict": actor.state_dict(), "critic_state_dict": critic.state_dict()}
    extended = extend_actions(state, list_terms(op3, action), narrow.names, action)
    wide_actor, wide_critic = make(many, action.size, "actor"), make(many + 5, 1, "critic")
    wide_actor.load_state_dict(extended["actor_state_dict"])
    wide_critic.load_state_dict(extended["critic_state_dict"])
    wide_actor.eval()
    wide_critic.eval()
    seen = torch.randn(10, many + 5)
    # The last actions of the new numbers, whatever they are, come before the torque share.
    old = torch.cat((seen[:, : few - 1], seen[:, many - 1 :]), dim=1)

    def ask(model: MLPModel, values: torch.Tensor) -> torch.Tensor:
        return model(TensorDict({"policy": values}, batch_size=[len(values)]))

    acted = ask(wide_actor, seen[:, :many])
    assert torch.allclose(acted[:, :k], ask(actor, old[:, :few]), atol=1e-6)
    assert torch.equal(acted[:, k:], torch.zeros(10, more))
    assert torch.allclose(ask(wide_critic, seen), ask(critic, old), atol=1e-6)
    deviation = extended["actor_state_dict"]["distribution.log_std_param"].exp()
    assert deviation[k:] == pytest.approx(FIRST_STD)
