"""Training: one seed one policy, and a kill that takes nothing back."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")
pytest.importorskip("gymnasium")
pytest.importorskip("tensorboard")

import torch

from sim2real.env import EnvOptions, GetUpEnv
from sim2real.rsl_env import RslEnv, mirror_batch
from sim2real.starts import StartPool
from sim2real.train import CHECKPOINT, PROGRESS, STEPS, Recipe, train

TINY = Recipe(
    rewards="quick",
    randomisation="all",
    apart=True,
    iterations=4,
    robots=8,
    hidden=(16, 16),
    falls=8,
    lift=0.8,
)


class KilledError(Exception):
    """The training was killed."""


def read_policy(folder: Path) -> dict[str, torch.Tensor]:
    state = torch.load(folder / CHECKPOINT, weights_only=False)
    parts = ("actor_state_dict", "critic_state_dict")
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
    train(op3, TINY, 1, folder, threads=1)
    return folder


def test_one_seed_is_one_policy_on_any_number_of_threads(op3, unbroken, tmp_path):
    train(op3, TINY, 1, tmp_path, threads=2)
    assert_same_policy(unbroken, tmp_path)
    assert what_was_learnt(unbroken) == what_was_learnt(tmp_path)


def test_another_seed_is_another_policy(op3, unbroken, tmp_path):
    train(op3, replace(TINY, iterations=1), 2, tmp_path, threads=1)
    name = "actor_state_dict.mlp.0.weight"
    assert not torch.equal(read_policy(unbroken)[name], read_policy(tmp_path)[name])


@pytest.mark.parametrize("killed_at", [0, 1, 3])
def test_a_killed_training_goes_on_as_if_nothing_had_happened(op3, unbroken, tmp_path, killed_at):
    with pytest.raises(KilledError):
        train(op3, TINY, 1, tmp_path, threads=1, report=kill_at(killed_at))
    train(op3, TINY, 1, tmp_path, threads=1)
    assert_same_policy(unbroken, tmp_path)
    assert what_was_learnt(unbroken) == what_was_learnt(tmp_path)


def test_a_training_that_is_done_can_be_given_more_iterations(op3, unbroken, tmp_path):
    train(op3, replace(TINY, iterations=2), 1, tmp_path, threads=1)
    train(op3, TINY, 1, tmp_path, threads=1)
    assert_same_policy(unbroken, tmp_path)


def test_a_training_that_is_done_is_left_as_it_is(op3, unbroken):
    before = (unbroken / CHECKPOINT).read_bytes(), (unbroken / PROGRESS).read_bytes()
    train(op3, TINY, 1, unbroken, threads=1)
    assert ((unbroken / CHECKPOINT).read_bytes(), (unbroken / PROGRESS).read_bytes()) == before


def test_progress_has_a_row_for_every_iteration(unbroken):
    rows = read_rows(unbroken)
    assert [int(row["iteration"]) for row in rows] == list(range(TINY.iterations))
    assert [int(row["steps"]) for row in rows] == [
        (i + 1) * STEPS * TINY.robots for i in range(TINY.iterations)
    ]
    seconds = [float(row["seconds"]) for row in rows]
    assert seconds == sorted(seconds)
    assert all(int(row["stood"]) <= int(row["falls"]) for row in rows)


def test_a_checkpoint_is_never_half_written(unbroken):
    assert not [file for file in unbroken.iterdir() if ".part" in file.name]


def test_symmetry_appends_the_mirror_images(op3, action, pool):
    env = RslEnv(GetUpEnv(op3, action, StartPool.of(pool.qpos), EnvOptions(robots=4, threads=1)))
    env.begin(0, np.random.default_rng(0))
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
