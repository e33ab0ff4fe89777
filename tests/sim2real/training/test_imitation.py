"""Imitation: which outputs lead back to a motion, and an actor that is fitted to them."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from made_up_rises import make_prior
from rsl_rl.models import MLPModel
from styled_env import make_styled_env
from tensordict import TensorDict

from humanoid_getup.policy.action import build_posture_spec
from robots import Robot
from sim2real.environment.action_heads import PriorHead
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts.start_pool import StartPool
from sim2real.training import imitation
from sim2real.training.imitation import find_outputs, imitate
from sim2real.training.library_threads import torch_threads
from sim2real.training.rsl_rl_env import RslEnv


@pytest.fixture
def env(op3: Robot, pool: StartPool) -> GetUpEnv:
    return make_styled_env(op3, pool, PriorHead(build_posture_spec(op3), make_prior(op3)))


def test_outputs_lead_to_the_next_targets_of_the_planned_motion(op3: Robot, env: GetUpEnv):
    """The first two curves have targets, those of the stance; the first alone is a plan's."""
    task, spec = env.style, build_posture_spec(op3)
    task.row[:] = [0, 1, 2] * 4
    wanted, measured = task.tracker.wanted, task.tracker.features
    for _ in range(12):  # outputs are limited, and filtered
        outputs, known = find_outputs(env, task)
        action, env.memory = task.head.decode(outputs, env.memory, wanted, measured)
    assert known.tolist() == [True, False, False] * 4
    targets = spec.home + spec.scale * action[known]
    assert targets == pytest.approx(np.tile(op3.standing.joint_pos, (4, 1)), abs=0.02)


def test_an_actor_comes_nearer_to_the_motions(env: GetUpEnv, monkeypatch: pytest.MonkeyPatch):
    for name, value in (("REPLAYED", 12), ("STEPS", 4), ("PARTS", 4), ("EPOCHS", 4)):
        monkeypatch.setattr(imitation, name, value)
    monkeypatch.setattr(imitation, "BATCH", 16)
    torch.manual_seed(0)
    wrapped = RslEnv(env)
    wrapped.begin(0, np.random.default_rng(0))
    size = wrapped.get_observations()["policy"].shape[1]
    blank = TensorDict({"policy": torch.zeros(1, size)}, batch_size=[1])
    actor = MLPModel(
        blank,
        {"actor": ["policy"]},
        "actor",
        wrapped.num_actions,
        hidden_dims=[16, 16],
        obs_normalization=True,
    )
    with torch_threads(1):
        losses = imitate(actor, wrapped, np.random.default_rng(0))
    assert len(losses) == 1 + 4
    assert losses[-1] < 0.8 * losses[0]
