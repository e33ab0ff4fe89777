"""Recipes and their file, and the log of a training: no row twice after a resume."""

import csv
import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from sim2real.training.config import RECIPE, RECIPES, STEPS, TrainingRecord, check_recipe
from sim2real.training.iteration_log import IterationLog, TrainReport


def make_record(**changes: object) -> dict:
    record = {"robot": "op3", "seed": 3, "actions": ["a"], "recipe": asdict(RECIPES["styled"])}
    return record | {"rewards": {"stands": 0.5}, "parent": None} | changes


def write_record(folder: Path, **changes: object) -> Path:
    file = folder / RECIPE
    file.write_text(json.dumps(make_record(**changes)))
    return file


def test_a_recipe_file_is_read_as_it_was_written(tmp_path: Path):
    for name, recipe in RECIPES.items():
        write_record(tmp_path, recipe=asdict(recipe))
        record = TrainingRecord.load(tmp_path)
        assert record.recipe == recipe, name
    assert (record.folder, record.robot, record.seed) == (tmp_path, "op3", 3)
    assert record.actions == ("a",)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"robot": 3}', "[" * 5000, "\xff"])
def test_a_file_of_something_else_is_refused_in_one_line(tmp_path: Path, text: str):
    (tmp_path / RECIPE).write_bytes(text.encode("latin-1"))
    with pytest.raises(match="is not a recipe of a training") as refusal:
        TrainingRecord.load(tmp_path)
    assert "\n" not in str(refusal.value)


def test_all_that_differs_is_named_but_the_number_of_iterations(tmp_path: Path):
    file = write_record(tmp_path)
    longer = asdict(replace(RECIPES["styled"], iterations=9))
    check_recipe(file, make_record(recipe=longer))
    other = asdict(replace(RECIPES["styled"], discount=0.5))
    with pytest.raises(ValueError) as refusal:
        check_recipe(file, make_record(seed=4, recipe=other))
    message = str(refusal.value)
    differences = "seed (3, now 4), recipe.discount (0.97, now 0.5)"
    assert message.startswith(f"{file}: made with another {differences}, expected the same")


QUICK = RECIPES["quick"]


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
    log = IterationLog(tmp_path / "progress.csv", QUICK, reports.append)
    run_iteration(log, falls=3, stood=1, alone=2, stood_alone=1, height_alone=1.5)
    run_iteration(log)
    first, second = read_rows(tmp_path / "progress.csv")
    assert (first["falls"], first["stood"]) == (str(3 * STEPS), str(STEPS))
    assert (first["alone"], first["stood_alone"]) == (str(2 * STEPS), str(STEPS))
    assert (first["height_alone"], second["height_alone"]) == ("0.75", "0.0"), "a mean"
    assert (second["falls"], second["stood"]) == (str(STEPS), "0"), "sums begin again"
    assert float(first["reward"]) == pytest.approx((STEPS - 1) / 2)
    assert (first["lift"], first["return_rate"], first["level"]) == ("0.25", "0.5", "2")
    assert [report.steps for report in reports] == [STEPS * QUICK.robots * k for k in (1, 2)]


def test_a_resumed_training_drops_the_rows_after_its_checkpoint(tmp_path: Path):
    file = tmp_path / "progress.csv"
    log = IterationLog(file, QUICK, lambda _: None)
    for _ in range(4):
        run_iteration(log)
    again = IterationLog(file, QUICK, lambda _: None)
    again.resume(2)
    assert [row["iteration"] for row in read_rows(file)] == ["0", "1"]
    run_iteration(again)
    assert [row["iteration"] for row in read_rows(file)] == ["0", "1", "2"]
