"""Several processes that train together: each its robots, one policy, and one that writes."""

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from distributed_training import TINY
from paths import REPOSITORY

from sim2real.training.config import RECIPES
from sim2real.training.distributed import DistributedProcess
from sim2real.training.train import check_processes

SCRIPT = REPOSITORY / "tests/support/distributed_training.py"


def test_each_process_of_torchrun_has_robots_and_a_gpu_of_its_own():
    # Two machines of two GPUs each.
    environments = [
        {"RANK": str(i), "LOCAL_RANK": str(i % 2), "WORLD_SIZE": "4", "LOCAL_WORLD_SIZE": "2"}
        for i in range(4)
    ]
    processes = [DistributedProcess.from_environment(environment) for environment in environments]
    assert [process.seed(7) for process in processes] == [7, 8, 9, 10]
    assert [process.device("cuda") for process in processes] == ["cuda:0", "cuda:1"] * 2
    assert [process.device("cpu") for process in processes] == ["cpu"] * 4
    assert [process.leads for process in processes] == [True, False, False, False]
    assert [process.count_robots(512) for process in processes] == [128] * 4


def test_what_several_processes_cannot_train_is_refused():
    three = DistributedProcess(of=3)
    with pytest.raises(ValueError, match="512 robots, expected a multiple of its 3 processes"):
        check_processes(RECIPES["quick"], three)
    with pytest.raises(ValueError, match="--overlap is given to 2 processes, expected one"):
        check_processes(replace(RECIPES["quick"], overlap=True), DistributedProcess(of=2))
    with pytest.raises(ValueError, match="style curves is given to 2 processes, expected one"):
        check_processes(RECIPES["styled"], DistributedProcess(of=2))


def train_by_two(folder: Path, *arguments: object) -> None:
    """Train by two processes of this machine."""
    torchrun = (sys.executable, "-m", "torch.distributed.run", "--standalone")
    line = [*torchrun, "--nproc-per-node", "2", str(SCRIPT), str(folder), *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("training")
    train_by_two(folder, TINY.iterations)
    return folder


@pytest.mark.train
def test_two_processes_learn_one_policy_from_robots_of_their_own(trained: Path):
    first, second = (read_process(trained, number) for number in range(2))
    assert first["actor"] == second["actor"]
    assert first["robots"] == second["robots"] == TINY.robots // 2
    assert first["joint_pos"] != second["joint_pos"]


@pytest.mark.train
def test_two_processes_that_resume_continue_with_the_curricula_of_all(
    trained: Path, tmp_path: Path
):
    folder = tmp_path / "resumed"
    shutil.copytree(trained, folder)
    train_by_two(folder, TINY.iterations + 2)
    before = read_process(trained, 0)
    first, second = (read_process(folder, number) for number in range(2))
    for name in ("lift", "ended", "success"):
        assert first["begun"][name] == second["begun"][name] == before[name]
        assert first[name] == second[name]
    assert first["actor"] == second["actor"] != before["actor"]
    with (folder / "progress.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == TINY.iterations + 2
    assert sum(int(row["falls"]) for row in rows) == first["ended"] > before["ended"] > 0


def read_process(folder: Path, number: int) -> dict[str, Any]:
    """Read what a process had at the end."""
    return json.loads((folder / f"process_{number}.json").read_text())
