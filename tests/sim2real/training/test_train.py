"""Training: one seed one policy, and a kill that takes nothing back."""

import csv
import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")
pytest.importorskip("gymnasium")
pytest.importorskip("tensorboard")

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from humanoid_getup.policy.observation import list_terms
from robots import Robot
from sim2real.environment.starts import StartPool
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.config import RECIPE, Recipe, TrainingRecord
from sim2real.training.export import export_policy
from sim2real.training.ppo import AVERAGE
from sim2real.training.runner import TrainingRunner, build_config
from sim2real.training.train import PROGRESS, Training

TINY = Recipe(
    rewards="quick",
    randomization="all",
    wide=True,
    iterations=4,
    robots=8,
    hidden=(16, 16),
    falls=8,
    lift=0.8,
)


class KilledError(Exception):
    """The training was killed."""


def read_policy(folder: Path) -> dict[str, torch.Tensor]:
    state = torch.load(folder / CHECKPOINT, weights_only=True)
    parts = ("actor_state_dict", "critic_state_dict", AVERAGE)
    return {f"{part}.{name}": value for part in parts for name, value in state[part].items()}


def read_rows(folder: Path) -> list[dict[str, str]]:
    with (folder / PROGRESS).open(newline="") as stream:
        return list(csv.DictReader(stream))


def assert_same_policy(one: Path, other: Path) -> None:
    first, second = read_policy(one), read_policy(other)
    assert first.keys() == second.keys()
    assert len(first) > 8
    different = [name for name, value in first.items() if not torch.equal(value, second[name])]
    assert different == []


def kill_at(iteration: int):
    def report(progress) -> None:
        if progress.iteration == iteration:
            raise KilledError

    return report


def what_was_learnt(folder: Path) -> list[dict[str, str]]:
    return [{k: v for k, v in row.items() if k != "seconds"} for row in read_rows(folder)]


@pytest.fixture(scope="module")
def unbroken(op3, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unbroken")
    Training(robot=op3, recipe=TINY, seed=1, folder=folder, threads=1).run()
    return folder


def test_one_seed_is_one_policy_on_any_number_of_threads(op3, unbroken, tmp_path):
    Training(robot=op3, recipe=TINY, seed=1, folder=tmp_path, threads=2).run()
    assert_same_policy(unbroken, tmp_path)
    assert what_was_learnt(unbroken) == what_was_learnt(tmp_path)


def test_a_training_with_other_rewards_does_not_go_on(op3, unbroken, tmp_path):
    folder = tmp_path / "training"
    shutil.copytree(unbroken, folder)
    record = json.loads((folder / RECIPE).read_text("utf-8"))
    record["rewards"]["stands"] = 7.0
    (folder / RECIPE).write_text(json.dumps(record), "utf-8")
    with pytest.raises(match=r"another rewards\.stands \(7\.0, now"):
        Training(robot=op3, recipe=TINY, seed=1, folder=folder, threads=1).run()


@pytest.mark.parametrize("killed_at", [0, 3])
def test_a_killed_training_continues_as_if_nothing_had_happened(op3, unbroken, tmp_path, killed_at):
    training = Training(robot=op3, recipe=TINY, seed=1, folder=tmp_path, threads=1)
    with pytest.raises(KilledError):
        training.run(kill_at(killed_at))
    training.run()
    assert_same_policy(unbroken, tmp_path)
    assert what_was_learnt(unbroken) == what_was_learnt(tmp_path)


def test_a_training_that_is_done_can_be_given_more_iterations(op3, unbroken, tmp_path):
    Training(
        robot=op3, recipe=replace(TINY, iterations=2), seed=1, folder=tmp_path, threads=1
    ).run()
    Training(robot=op3, recipe=TINY, seed=1, folder=tmp_path, threads=1).run()
    assert_same_policy(unbroken, tmp_path)


@pytest.fixture(scope="module")
def parent(op3, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A training whose policy moves both sides alike."""
    folder = tmp_path_factory.mktemp("parent")
    Training(
        robot=op3, recipe=replace(TINY, wide=False, iterations=2), seed=1, folder=folder, threads=1
    ).run()
    return folder


def load_actor(robot: Robot, folder: Path, recipe: Recipe) -> MLPModel:
    action = recipe.choose_actions(robot)
    size = sum(term.size for term in list_terms(robot, action))
    config = build_config(recipe, 0)["actor"]
    del config["class_name"]
    blank = TensorDict({"policy": torch.zeros(1, size)}, batch_size=[1])
    actor = MLPModel(blank, {"actor": ["policy"]}, "actor", action.size, **config)
    actor.load_state_dict(read_checkpoint(folder / CHECKPOINT)["actor_state_dict"])
    return actor.eval()


def test_a_training_begins_with_its_parents_policy(op3, parent, tmp_path, monkeypatch):
    def save_and_stop(self: TrainingRunner, *_: object, **__: object) -> None:
        self.save("")

    monkeypatch.setattr(TrainingRunner, "learn", save_and_stop)  # before the first update
    Training(
        robot=op3,
        recipe=replace(TINY, iterations=1),
        seed=2,
        folder=tmp_path,
        threads=1,
        parent=parent,
    ).run()
    old = load_actor(op3, parent, replace(TINY, wide=False))
    new = load_actor(op3, tmp_path, TINY)
    k = len(op3.rising_joints)
    seen = torch.randn(32, new.obs_dim, generator=torch.Generator().manual_seed(0))
    # The last numbers of the last action, which the parent does not know, and the torque share.
    known = torch.cat((seen[:, : old.obs_dim - 1], seen[:, -1:]), dim=1)
    acted, wanted = (
        model(TensorDict({"policy": values}, batch_size=[32])).detach()
        for model, values in ((new, seen), (old, known))
    )
    assert torch.allclose(acted[:, :k], wanted, atol=1e-6)
    assert wanted.abs().max() > 1e-3
    assert acted[:, k:].eq(0.0).all()


def test_a_training_tells_its_parent_by_its_content_and_learns_on(op3, parent, tmp_path):
    Training(
        robot=op3,
        recipe=replace(TINY, iterations=1),
        seed=2,
        folder=tmp_path,
        threads=1,
        parent=parent,
    ).run()
    message = json.loads((tmp_path / RECIPE).read_text("utf-8"))["parent"]
    digest = hashlib.sha256((parent / CHECKPOINT).read_bytes()).hexdigest()
    assert message == {"recipe": "quick", "seed": 1, "iterations": 2, "sha256": digest}
    facts = TrainingRecord.load(tmp_path).provenance
    about = {key: value for key, value in facts.items() if key.startswith("parent.")}
    assert about == {"parent.recipe": "quick", "parent.seed": 1, "parent.iterations": 2}
    assert [row["iteration"] for row in read_rows(tmp_path)] == ["0"]
    with pytest.raises(match="parent"):
        Training(
            robot=op3, recipe=replace(TINY, iterations=1), seed=2, folder=tmp_path, threads=1
        ).run()


def test_a_policy_file_begins_a_training_on_terrain(op3, unbroken, tmp_path):
    file, folder = tmp_path / "parent.onnx", tmp_path / "rough"
    export_policy(TrainingRecord.load(unbroken), op3, file)
    rough = replace(TINY, terrain=True, falls=2, learning_rate=0.0, iterations=1)
    Training(robot=op3, recipe=rough, seed=2, folder=folder, threads=1, parent=file).run()
    exported = torch.load(unbroken / CHECKPOINT, weights_only=True)[AVERAGE]
    begun = torch.load(folder / CHECKPOINT, weights_only=True)["actor_state_dict"]
    layers = [name for name in exported if name.startswith("mlp.")]
    assert len(layers) == 6
    assert all(torch.equal(exported[name], begun[name]) for name in layers)
    std = "obs_normalizer._std"
    assert torch.allclose(exported[std], begun[std], rtol=1e-4, atol=1e-5)
    levels = StartPool.load(folder / "falls.npz", op3, 27).level
    assert np.bincount(levels).tolist() == [4, 4, 4, 4]
    with pytest.raises(match=r"parent.onnx: it has actions .* expected"):
        narrow, other = replace(rough, wide=False), tmp_path / "other"
        Training(robot=op3, recipe=narrow, seed=2, folder=other, threads=1, parent=file).run()
