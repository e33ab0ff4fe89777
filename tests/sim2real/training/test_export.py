"""Export: one file that acts like the checkpoint, or none; and a policy file as a parent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")
pytest.importorskip("gymnasium")
pytest.importorskip("onnx")
pytest.importorskip("onnxscript")

import onnx
import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from humanoid_getup.commands.main import main
from humanoid_getup.policy.observation import list_terms
from humanoid_getup.policy.onnx_file import CHECKSUM_ENTRY, OnnxNetwork, read_model, seal_model
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot
from sim2real.training.checkpoint import CHECKPOINT
from sim2real.training.config import RECIPES, Recipe, TrainingRecord
from sim2real.training.export import MOST_BYTES, export_policy
from sim2real.training.policy_parent import check_policy_parent, is_policy_file
from sim2real.training.ppo import AVERAGE, UPDATES
from sim2real.training.runner import build_config
from sim2real.training.train import Training

SEED = 7
MINE = replace(RECIPES["robust"], hidden=(32, 16))


def make_actor(training: TrainingRecord, robot: Robot):
    """An actor as it comes out of a training: weights and normalizer far from their first."""
    action = training.recipe.choose_actions(robot)
    size = sum(term.size for term in list_terms(robot, action))
    torch.manual_seed(SEED)
    blank = make_blank(training, size, action.size)
    blank.train()
    for _ in range(3):
        seen = TensorDict({"policy": 2.0 + 3.0 * torch.randn(64, size)}, batch_size=[64])
        blank.update_normalization(seen)
    with torch.no_grad():
        for value in blank.parameters():
            value.add_(0.1 * torch.randn_like(value))
    return blank


def make_blank(training: TrainingRecord, size: int, actions: int):
    config = build_config(training.recipe, training.seed)
    network = {key: value for key, value in config["actor"].items() if key != "class_name"}
    example = TensorDict({"policy": torch.zeros(1, size)}, batch_size=[1])
    return MLPModel(example, config["obs_groups"], "actor", actions, **network)


def make_training(folder: Path, robot: Robot, recipe: Recipe = MINE) -> TrainingRecord:
    folder.mkdir(exist_ok=True)
    Training(robot=robot, recipe=recipe, seed=SEED, folder=folder).write_recipe()
    training = TrainingRecord.load(folder)
    actor = make_actor(training, robot)
    newest = {name: torch.zeros_like(value) for name, value in actor.state_dict().items()}
    state = {"actor_state_dict": newest, AVERAGE: actor.state_dict(), UPDATES: 42, "iter": 41}
    torch.save(state, folder / CHECKPOINT)
    return training


def test_what_is_exported_acts_like_the_checkpoint_and_tells_how_it_was_made(
    op3: Robot, tmp_path: Path
):
    name = "gentle"
    training = make_training(tmp_path / "training", op3, RECIPES[name])
    file = tmp_path / "new" / "policy.onnx"
    export = export_policy(training, op3, file)
    assert export.difference <= 1e-5
    assert export.size == file.stat().st_size < MOST_BYTES
    assert [path.name for path in file.parent.iterdir()] == ["policy.onnx"]
    policy = OnnxPolicy.load(file, op3, op3.control_period)
    assert policy.action.pwm_limit == RECIPES[name].pwm_limit
    provenance = policy.contract.provenance
    assert (provenance["recipe"], provenance["seed"], provenance["iterations"]) == (name, SEED, 42)
    actor = make_actor(training, op3).eval()
    network = OnnxNetwork(file)
    for seen in np.random.default_rng(0).normal(2.0, 3.0, size=(20, actor.obs_dim)):
        seen = np.float32(seen)[None]
        with torch.no_grad():
            wanted = actor(TensorDict({"policy": torch.from_numpy(seen)}, batch_size=[1]))
        np.testing.assert_allclose(network(seen)[0], wanted.numpy(), atol=1e-5)


def spoil(training: TrainingRecord, change) -> None:
    file = training.folder / CHECKPOINT
    state = torch.load(file, weights_only=True)
    change(state)
    torch.save(state, file)


def add_nan(state: dict) -> None:
    state[AVERAGE]["mlp.0.weight"][0, 0] = torch.nan


def lose_a_layer(state: dict) -> None:
    del state[AVERAGE]["mlp.2.weight"]


def lose_the_actor(state: dict) -> None:
    del state[AVERAGE]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (add_nan, "holds NaN or infinity: mlp.0.weight"),
        (lose_a_layer, "does not fit robot and recipe.*mlp.2.weight"),
        (lose_the_actor, "is not a checkpoint of a training"),
    ],
)
def test_a_checkpoint_that_is_none_of_the_training_is_refused(
    op3: Robot, tmp_path: Path, change, message: str
):
    training = make_training(tmp_path / "training", op3)
    spoil(training, change)
    file = tmp_path / "policy.onnx"
    file.write_text("an earlier one")
    with pytest.raises(ValueError, match=message):
        export_policy(training, op3, file)
    assert file.read_text() == "an earlier one"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["policy.onnx", "training"]


def test_the_command_exports(op3: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    make_training(tmp_path / "training", op3)
    file = tmp_path / "policy.onnx"
    assert main(["export", str(tmp_path / "training"), "--out", str(file)]) == 0
    assert "after 42 iterations" in capsys.readouterr().out
    assert OnnxPolicy.load(file, op3, op3.control_period).failure is None


def shipped(robot: Robot, name: str) -> Path:
    return robot.folder / "policies" / f"{name}.onnx"


def test_a_policy_of_the_recipes_actions_begins_a_training(op3: Robot):
    check_policy_parent(shipped(op3, "robust"), op3, RECIPES["rough"])
    assert is_policy_file(shipped(op3, "robust"))
    assert not is_policy_file(op3.folder)


@pytest.mark.parametrize(
    ("policy", "recipe", "message"),
    [
        ("robust", "styled", "follows no style curves, expected a policy that does"),
        ("styled", "rough", "follows style curves, expected a policy that does not"),
        ("quick", "rough", "it has actions .*; expected"),
    ],
)
def test_a_policy_of_another_kind_is_refused(op3: Robot, policy: str, recipe: str, message: str):
    with pytest.raises(match=message):
        check_policy_parent(shipped(op3, policy), op3, RECIPES[recipe])


def test_a_policy_that_holds_nan_cannot_begin_a_training(op3, tmp_path):
    bare = read_model(op3.folder / "policies" / "robust.onnx").rpartition(CHECKSUM_ENTRY)[0]
    model = onnx.load_model_from_string(bare)
    (weight,) = (v for v in model.graph.initializer if v.name.endswith("mlp.0.weight"))
    spoilt = np.full_like(onnx.numpy_helper.to_array(weight), np.nan)
    weight.CopyFrom(onnx.numpy_helper.from_array(spoilt, weight.name))
    file = tmp_path / "nan.onnx"
    file.write_bytes(seal_model(model.SerializeToString()))
    with pytest.raises(match="its network holds NaN or infinity"):
        check_policy_parent(file, op3, RECIPES["rough"])
