"""Recipes and their file: what is written is read again, and what differs is named."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from robots import Robot
from sim2real.training.config import RECIPE, RECIPES, TrainingRecord, check_recipe


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


def test_a_policy_with_style_moves_every_joint(op3: Robot):
    assert RECIPES["styled"].choose_actions(op3).names == op3.joint_names
    gentle = RECIPES["gentle"].choose_actions(op3)
    assert gentle.pwm_limit == 0.55
    assert len(gentle.names) == 2 * len(op3.rising_joints + op3.spreading_joints)
