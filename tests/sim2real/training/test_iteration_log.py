"""The log of a training: a row for every iteration, sums of it, and none twice after a resume."""

import csv
from pathlib import Path
from typing import Any

import pytest

from sim2real.training.config import RECIPES, STEPS
from sim2real.training.distributed import DistributedProcess
from sim2real.training.iteration_log import IterationLog, TrainReport

RECIPE = RECIPES["quick"]
ALONE = DistributedProcess.from_environment({})


def read_rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def run_iteration(log: IterationLog, *, steps: int = STEPS, **counts: float) -> None:
    """Log the policy steps of one iteration; their rewards are 0, 1, 2..."""
    nothing = {"falls": 1, "stood": 0, "alone": 0, "stood_alone": 0, "height_alone": 0.0}
    for step in range(steps):
        info = nothing | counts | {"task_reward": 0.5, "level": 2}
        log(float(step), info | {"assistive_force": 0.25})


def test_a_row_is_the_sum_of_an_iteration_and_is_reported(tmp_path: Path):
    reports: list[TrainReport] = []
    log = IterationLog(tmp_path / "progress.csv", RECIPE, reports.append, ALONE)
    run_iteration(log, falls=3, stood=1, alone=2, stood_alone=1, height_alone=1.5)
    run_iteration(log)
    first, second = read_rows(tmp_path / "progress.csv")
    assert (first["falls"], first["stood"]) == (str(3 * STEPS), str(STEPS))
    assert (first["alone"], first["stood_alone"]) == (str(2 * STEPS), str(STEPS))
    assert (first["height_alone"], second["height_alone"]) == ("0.75", "0.0"), "a mean"
    assert (second["falls"], second["stood"]) == (str(STEPS), "0"), "sums begin again"
    assert float(first["reward"]) == pytest.approx((STEPS - 1) / 2)
    assert (first["lift"], first["return_rate"], first["level"]) == ("0.25", "0.5", "2")
    assert [report.steps for report in reports] == [STEPS * RECIPE.robots * k for k in (1, 2)]


def test_a_resumed_training_drops_the_rows_after_its_checkpoint(tmp_path: Path):
    file = tmp_path / "progress.csv"
    log = IterationLog(file, RECIPE, lambda _: None, ALONE)
    for _ in range(4):
        run_iteration(log)
    again = IterationLog(file, RECIPE, lambda _: None, ALONE)
    again.resume(2)
    assert [row["iteration"] for row in read_rows(file)] == ["0", "1"]
    run_iteration(again)
    assert [row["iteration"] for row in read_rows(file)] == ["0", "1", "2"]


class OneOfTwins(DistributedProcess):
    """A process whose partner counts the same."""

    def gather(self, value: Any) -> list[Any]:
        return [value, value]


def test_of_several_processes_the_first_alone_writes_and_counts_for_all(tmp_path: Path):
    reports: list[TrainReport] = []
    for rank in (1, 0):
        process = OneOfTwins(number=rank, local=rank, of=2)
        log = IterationLog(tmp_path / "progress.csv", RECIPE, reports.append, process)
        log.resume(0)
        run_iteration(log)
        assert (tmp_path / "progress.csv").exists() == (rank == 0)
    own: list[TrainReport] = []
    run_iteration(IterationLog(tmp_path / "own.csv", RECIPE, own.append, ALONE))
    assert [report.steps for report in reports] == [STEPS * RECIPE.robots]
    assert [report.falls for report in reports] == [2 * report.falls for report in own]
    assert own[0].falls > 0
    assert [report.reward for report in reports] == [report.reward for report in own]
