"""`getup train --physics warp`: one training, and what it refuses in one line."""

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

from run_getup import Run

from humanoid_getup.simulation.physics_engine import PhysicsName
from sim2real.training.config import RECIPE, RECIPES, check_recipe

pytestmark = [pytest.mark.train, pytest.mark.warp]

TINY = ("train", "--out", "mine", "--iterations", "1", "--robots", "4", "--threads", "1")
ON_WARP = (*TINY, "--physics", "warp")


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run `getup` in an empty folder, with recipes that are over in a moment."""
    for name in ("quick", "rough"):
        tiny = replace(RECIPES[name], hidden=(8, 8), falls=4)
        monkeypatch.setitem(RECIPES, name, tiny)
    return run


def test_a_training_on_mujoco_warp_continues_and_is_no_other_one(run: Run):
    pytest.importorskip("mujoco_warp", reason="needs the `warp` extra: make test-warp")
    code, out, _ = run(*ON_WARP)
    assert code == 0
    assert out.startswith("mine: 1 iterations")
    assert json.loads(Path("mine", RECIPE).read_text())["recipe"]["physics"] == "warp"
    code, out, _ = run(*ON_WARP, "--iterations", "2")
    assert (code, out.startswith("mine: 2 iterations")) == (0, True)
    code, out, error = run(*TINY, "--iterations", "2")
    assert (code, out) == (2, "")
    assert "recipe.physics (warp, now mujoco)" in error


def test_a_folder_from_before_the_option_is_a_training_on_mujoco(tmp_path: Path):
    file = tmp_path / RECIPE
    file.write_text('{"recipe": {"robots": 4}}')
    recipe = {"robots": 4, "physics": get_args(PhysicsName)[0], "overlap": False}
    check_recipe(file, {"recipe": recipe})
    with pytest.raises(match=r"recipe.physics \(mujoco, now warp\)"):
        check_recipe(file, {"recipe": recipe | {"physics": "warp"}})
