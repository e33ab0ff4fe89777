"""`getup train`: a story of its own, and what it refuses in one line."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")
# Before any film strip: triton crashes if it is loaded after Mesa's LLVM.
pytest.importorskip("tensordict")
pytest.importorskip("gymnasium")
pytest.importorskip("tensorboard")

from run_getup import Run

from humanoid_getup.progress.callback import Progress
from sim2real.training.config import RECIPES

pytestmark = pytest.mark.train

TINY = ("train", "--out", "mine", "--iterations", "2", "--robots", "4", "--threads", "1")


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run `getup` in an empty folder, with a `quick` recipe that is over in a moment."""
    tiny = replace(RECIPES["quick"], hidden=(8, 8), falls=4)
    monkeypatch.setitem(RECIPES, "quick", tiny)
    return run


def refuse(run: Run, *arguments: str) -> str:
    """Run what must be refused; return the one line."""
    before = {file: file.read_bytes() for file in Path.cwd().rglob("*") if file.is_file()}
    code, out, error = run(*arguments)
    message = [line for line in error.splitlines() if line.startswith("getup: ")]
    assert (code, out, len(message)) == (2, "", 1)
    after = {file: file.read_bytes() for file in Path.cwd().rglob("*") if file.is_file()}
    assert after == before
    return message[0]


def test_a_training_continues_where_it_stopped(run: Run):
    code, out, _ = run(*TINY)
    assert code == 0
    assert out.startswith("mine: 2 iterations, 0.00 million steps in ")
    assert {"checkpoint.pt", "falls.npz", "progress.csv", "recipe.json"} <= {
        file.name for file in Path("mine").iterdir()
    }
    assert "trained already" in run(*TINY)[1]
    code, out, _ = run(*TINY, "--iterations", "3")
    assert code == 0
    assert out.startswith("mine: 3 iterations")
    assert json.loads(Path("mine/recipe.json").read_text())["recipe"]["iterations"] == 3


def test_another_training_in_the_folder_is_reported_and_left_alone(run: Run):
    assert run(*TINY)[0] == 0
    line = refuse(run, *TINY, "--robots", "5", "--seed", "7")
    assert "mine/recipe.json: made with another" in line
    assert "recipe.robots (4, now 5)" in line
    assert "seed (0, now 7)" in line


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("checkpoint.pt", b"PK\x03\x04 and no more", "checkpoint.pt is not a complete checkpoint"),
        ("recipe.json", b"{", "recipe.json is not a recipe of a training"),
        ("recipe.json", b"[1]", "recipe.json is not a recipe of a training"),
        ("falls.npz", b"PK", "falls.npz holds no starts, expected an .npz"),
    ],
)
def test_a_spoilt_file_of_a_training_is_named(run: Run, name: str, content: bytes, message: str):
    assert run(*TINY)[0] == 0
    Path("mine", name).write_bytes(content)
    code, out, error = run(*TINY, "--iterations", "3")
    assert (code, out) == (2, "")
    assert message in error
    assert Path("mine", name).read_bytes() == content


def test_an_interrupted_training_leaves_130_and_its_checkpoint(run: Run, monkeypatch):
    def interrupt(_: object, progress: Progress) -> None:
        if progress.total is not None:
            raise KeyboardInterrupt

    assert run(*TINY)[0] == 0
    before = Path("mine/checkpoint.pt").read_bytes()
    monkeypatch.setattr("humanoid_getup.commands.console.ProgressDisplay.show", interrupt)
    code, _, error = run(*TINY, "--iterations", "4")
    assert code == 130
    assert "the same command continues from it" in error
    assert Path("mine/checkpoint.pt").read_bytes() == before
