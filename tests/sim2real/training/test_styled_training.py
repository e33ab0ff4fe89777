"""A training with style curves: what it imitates, from made-up rises to a policy on the robot."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("rsl_rl")
onnx = pytest.importorskip("onnx")

from made_up_rises import make_prior, make_rises
from rsl_rl.models import MLPModel
from styled_env import make_styled_env
from tensordict import TensorDict

from humanoid_getup.policy.action import build_posture_spec
from humanoid_getup.policy.observation import UPRIGHT
from humanoid_getup.policy.onnx_file import OnnxNetwork
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.style.style import load_style
from robots import Robot
from sim2real.environment.action_heads import PriorHead
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts import StartPool
from sim2real.pose_prior import PRIOR, RISES
from sim2real.training import imitation, runner
from sim2real.training.config import RECIPES, Recipe, TrainingRecord
from sim2real.training.export import export_policy
from sim2real.training.imitation import find_outputs, imitate
from sim2real.training.library_threads import torch_threads
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.train import POOL, Training

QUICK = replace(RECIPES["styled-quick"], robots=8, iterations=1, hidden=(16, 16))


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    for steps in ("REPLAYED", "STEPS"):
        monkeypatch.setattr(imitation, steps, 6)
    monkeypatch.setattr(imitation, "PARTS", 2)
    monkeypatch.setattr(imitation, "EPOCHS", 1)
    monkeypatch.setattr(runner, "CRITIC_ROUNDS", 1)


@pytest.fixture(scope="module")
def prior(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("prior")
    make_prior(op3).save(folder / PRIOR)
    make_rises(op3, 12).save(folder / RISES)
    return folder


@pytest.fixture
def learn(op3: Robot, prior: Path, pool: StartPool, tmp_path: Path):
    """Train into a folder of a name."""

    def train_into(name: str, recipe: Recipe = QUICK, **options: object) -> Path:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        if not (folder / POOL).exists():
            pool.save(folder / POOL, op3)
        given: Any = {"prior": prior} | options
        Training(robot=op3, recipe=recipe, seed=3, folder=folder, threads=1, **given).run()
        return folder

    return train_into


def read_actor(folder: Path) -> dict:
    state = torch.load(folder / "checkpoint.pt", weights_only=True)
    return {key: value for key, value in state["actor_state_dict"].items() if "mlp" in key}


def test_a_training_imitates_first_and_keeps_its_statistics(learn):
    folders = [learn(f"after {count}", replace(QUICK, iterations=count)) for count in (1, 3)]
    first, last = (
        torch.load(folder / "checkpoint.pt", weights_only=True)["actor_state_dict"]
        for folder in folders
    )
    statistics = [name for name in first if "normalizer" in name]
    assert len(statistics) > 3
    assert all(torch.equal(first[name], last[name]) for name in statistics)
    name = next(name for name in first if name.endswith("kept.0.weight"))
    assert not torch.equal(first[name], last[name])


def test_a_trained_policy_follows_a_style_and_its_graph_does_what_training_did(
    op3, learn, tmp_path
):
    """The filter, the decoder and the offsets in the file are those of the environment."""
    record, file = TrainingRecord.load(learn("one")), tmp_path / "styled.onnx"
    assert record.actions == ("latent 0", "latent 1", "latent 2", *op3.joint_names)
    assert export_policy(record, op3, file).difference < 1e-5
    policy = OnnxPolicy.load(file, op3, style=load_style("side-sit", op3))
    assert policy.contract.style is not None
    assert policy.contract.style.memory == 3 + op3.n
    assert OnnxPolicy.load(file, op3).style.name == "any"
    head = PriorHead(policy.action, make_prior(op3))
    rng, size = np.random.default_rng(0), policy.contract.observation_size
    seen = rng.normal(0.0, 0.7, (40, size)).astype(np.float32)
    ends = np.cumsum([term.size for term in policy.contract.observation])
    at = {t.name: e - t.size for t, e in zip(policy.contract.observation, ends, strict=True)}
    before = seen[:, at["last_action"] : at["last_action"] + len(head.names)]
    action, memory = OnnxNetwork(file)(seen)
    outputs = (memory - 0.6 * before) / 0.4
    wanted, measured = (
        seen[:, at[name] : at[name] + 3] + UPRIGHT for name in ("style_targets", "style_features")
    )
    again, remembered = head.decode(outputs, before, wanted, measured)
    assert action == pytest.approx(again, abs=1e-4)
    assert memory == pytest.approx(remembered, abs=1e-5)


def test_one_seed_trains_one_policy_interrupted_or_not(learn):
    whole = learn("whole", replace(QUICK, iterations=3))
    for iterations in (1, 2, 3):
        parts = learn("parts", replace(QUICK, iterations=iterations))
    one, other = read_actor(whole), read_actor(parts)
    assert one
    assert all(torch.equal(one[key], other[key]) for key in one)


def test_a_policy_file_and_a_training_begin_the_next_one(op3, learn, tmp_path):
    first, file = learn("first"), tmp_path / "styled.onnx"
    export_policy(TrainingRecord.load(first), op3, file)
    onward = replace(QUICK, randomization="mild")
    none = replace(onward, learning_rate=0.0)  # so that what was inherited can be seen
    for name, parent in (("file", file), ("folder", first)):
        folder = learn(name, none, parent=parent)
        about = json.loads((folder / "recipe.json").read_text())["parent"]
        assert about["sha256"]
    inherited, parent = read_actor(tmp_path / "file"), read_actor(first)
    # The file holds the average of the updates, after one of them the actor itself.
    assert all(torch.allclose(inherited[key], parent[key], atol=1e-3) for key in parent)


def test_a_training_needs_a_prior_and_keeps_to_it_and_to_that_of_its_parent(
    op3, learn, prior, tmp_path
):
    with pytest.raises(match=r"none has no prior.npz, expected --prior"):
        learn("none", prior=None)
    folder, file = learn("one"), tmp_path / "styled.onnx"
    learn("one", prior=None)  # its own copy
    export_policy(TrainingRecord.load(folder), op3, file)
    other = tmp_path / "other"
    other.mkdir()
    make_prior(op3, 4).save(other / PRIOR)
    (other / RISES).write_bytes((prior / RISES).read_bytes())
    with pytest.raises(match=f"{folder / PRIOR} is another file"):
        learn("one", prior=other)
    for parent, message in ((file, "was trained with another prior"), (folder, "another prior")):
        with pytest.raises(match=message):
            learn("next", prior=other, parent=parent)
        assert not (tmp_path / "next" / "recipe.json").exists()


def test_a_height_map_is_added_to_what_was_learned(op3, learn, tmp_path):
    sees = replace(QUICK, learning_rate=0.0, style=replace(QUICK.style, height_map=True))
    with pytest.raises(match="expected --parent"):
        learn("blank", sees)
    first = learn("first", replace(QUICK, learning_rate=0.0))
    folders = {"blind": first, "seeing": learn("seeing", sees, parent=first)}
    for name, folder in folders.items():
        export_policy(TrainingRecord.load(folder), op3, tmp_path / f"{name}.onnx")
    contract = OnnxPolicy.load(tmp_path / "seeing.onnx", op3).contract
    assert contract.style.height_map
    assert contract.observation[-1].name == "height_map"
    blind, seeing = (OnnxNetwork(tmp_path / f"{name}.onnx") for name in folders)
    rng = np.random.default_rng(0)
    seen = rng.normal(0.0, 0.5, (20, contract.observation_size)).astype(np.float32)
    for own, other in zip(seeing(seen), blind(seen[:, :-25]), strict=True):
        assert own == pytest.approx(other, abs=1e-5)


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
