"""`getup train`: a story of its own, what it refuses in one line, and what it says of itself.

Stands that the assistive force holds do not count.
"""

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

from humanoid_getup.commands.learn.train import ASSESSED, TrainedPolicy
from humanoid_getup.progress.callback import Progress
from sim2real.training.config import RECIPE, RECIPES
from sim2real.training.iteration_log import TrainReport

pytestmark = pytest.mark.train

TINY = ("train", "--out", "mine", "--iterations", "2", "--robots", "4", "--threads", "1")
SPENT = {"iteration": 0, "iterations": 500, "steps": 10_240, "seconds": 10.0, "reward": 0.1}
ENDS = {"falls": 100, "stood": 60, "alone": 10, "stood_alone": 0, "height_alone": 0.4}
HELPED = TrainReport(**SPENT, **ENDS, lift=0.8)
"""Of 100 falls 60 end standing, all of them with help."""


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run `getup` in an empty folder, with a `quick` recipe that is over in a moment."""
    tiny = replace(RECIPES["quick"], hidden=(8, 8), falls=4)
    monkeypatch.setitem(RECIPES, "quick", tiny)
    return run


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


def test_another_training_in_the_folder_and_a_spoilt_file_are_told_and_left_alone(run: Run):
    def list_files() -> dict[Path, bytes]:
        return {file: file.read_bytes() for file in Path.cwd().rglob("*") if file.is_file()}

    assert run(*TINY)[0] == 0
    whole = list_files()
    code, out, error = run(*TINY, "--robots", "5", "--seed", "7")
    assert (code, out) == (2, "")
    assert "mine/recipe.json: made with another" in error
    assert "recipe.robots (4, now 5)" in error
    assert "seed (0, now 7)" in error
    assert list_files() == whole
    for name, content, message in (
        ("checkpoint.pt", b"PK\x03\x04 and no more", "checkpoint.pt is not a complete checkpoint"),
        ("recipe.json", b"{", "recipe.json is not a recipe of a training"),
        ("recipe.json", b"[1]", "recipe.json is not a recipe of a training"),
        ("falls.npz", b"PK", "falls.npz holds no starts, expected an .npz"),
    ):
        file = Path.cwd() / "mine" / name
        file.write_bytes(content)
        code, out, error = run(*TINY, "--iterations", "3")
        assert (code, out) == (2, "")
        assert message in error
        assert file.read_bytes() == content
        file.write_bytes(whole[file])


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


@pytest.mark.warp
def test_a_training_on_mujoco_warp_continues_and_is_no_other_one(run: Run):
    pytest.importorskip("mujoco_warp", reason="needs the `warp` extra: make test-warp")
    code, out, _ = run(*TINY, "--physics", "warp")
    assert (code, out.startswith("mine: 2 iterations")) == (0, True)
    assert json.loads(Path("mine", RECIPE).read_text())["recipe"]["physics"] == "warp"
    code, out, _ = run(*TINY, "--physics", "warp", "--iterations", "3")
    assert (code, out.startswith("mine: 3 iterations")) == (0, True)
    code, out, error = run(*TINY, "--iterations", "3")
    assert (code, out) == (2, "")
    assert "recipe.physics (warp, now mujoco)" in error


def begin(motions: int = 3) -> TrainedPolicy:
    return TrainedPolicy(motions=motions, lift=HELPED.lift)


def report(policy: TrainedPolicy, **fields: float) -> str:
    """Report an iteration; return what it told."""
    return policy.note(replace(HELPED, **fields))


def test_robots_that_stand_alone_or_with_less_help_now_or_before_it_was_continued_are_learning():
    policy = begin()
    report(policy)
    assert (policy.share, policy.is_learning) == (0.0, False), "they stand by the force alone"
    said = "60% of falls end standing with up to 80% of the weight held, 0% without help"
    assert said in str(policy)
    for better in ({"stood_alone": 3}, {"lift": 0.75}):
        policy = begin()
        report(policy)
        for _ in range(20):
            report(policy, **better)
        assert policy.is_learning, better
    continued = begin()
    report(continued, iteration=200, lift=0.3)
    assert continued.is_learning


def test_without_a_fall_of_a_kind_no_share_of_it_is_told():
    policy = begin()
    report(policy, falls=0, stood=0, alone=0)
    assert policy.describe() == "no fall has ended yet"
    report(policy, falls=0, stood=0, alone=0, level=2)
    assert policy.describe().endswith("yet; episodes begin on the way, up to level 2")
    assert policy.is_learning
    report(policy, alone=0)
    assert policy.describe().endswith("of the weight held")


def test_after_ten_minutes_it_is_told_once_whether_the_body_is_learning_and_what_it_lacks():
    policy = begin()
    report(policy, seconds=20.0)
    assert policy.assess().endswith("0% without help: too short to judge")
    assert report(policy, seconds=ASSESSED - 1.0) == ""
    told = report(policy, seconds=ASSESSED)
    assert told.startswith("after 10 min 60% of falls end standing with up to 80%")
    assert "not learned yet; necks end at 40% of the standing height" in told
    assert report(policy, seconds=ASSESSED + 10.0) == ""
    for motions, neck, lacks in (
        (0, 0.4, "`getup motions discover` finds some"),
        (3, 0.4, "`getup robots check` names joints that are too weak"),
        (3, 0.9, "more --iterations may do"),
    ):
        assert lacks in report(begin(motions), seconds=ASSESSED, height_alone=neck)
