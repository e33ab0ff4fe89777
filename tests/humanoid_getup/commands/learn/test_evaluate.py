"""`getup eval`: figures by class for a policy, the same on every engine."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("onnx")

from paths import REPOSITORY
from tiny_policies import save_policy

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.learn.evaluate import EvaluateRequest, evaluate
from humanoid_getup.commands.main import main
from humanoid_getup.experiments.falls import CLASSES, Fall, FallSet
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.progress.callback import Progress
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot
from robots.storage.encoding import to_json
from sim2real import evaluation


@pytest.fixture
def policy(op3: Robot, tmp_path: Path) -> str:
    """A policy that does nothing."""
    return str(save_policy(tmp_path / "idle.onnx", op3))


@pytest.fixture
def falls(op3: Robot, tmp_path: Path) -> Path:
    """ "Falls" that stand, so that doing nothing is right."""
    file = tmp_path / "falls.npz"
    falls = tuple(Fall(posture=op3.standing, start_class=kind) for kind in CLASSES * 2)
    FallSet(robot="op3", scene="flat", seed=5, falls=falls).save(file)
    return file


def test_eval_counts_every_class(policy: str, falls: Path, tmp_path: Path):
    out = tmp_path / "eval.json"
    words = ("eval", policy, "--n", "4", "--falls", str(falls), "--delay", "20", "--json", str(out))
    assert main(words) == 0
    figures = json.loads(out.read_text())
    assert (figures["name"], figures["policy"], figures["n"]) == ("eval", "idle", 4)
    (case,) = figures["cases"].values()
    assert (figures["trial"], case["falls_seed"], case["grounds"]) == ("delay 0.02 s", 5, 1)
    for kind in CLASSES:
        assert (case["classes"][kind]["n"], case["classes"][kind]["stood"]) == (1, 1)
    assert (case["scene"], case["style"], case["all"]["stood"]) == ("flat", None, 4)
    assert case["all"]["height_error"]["median"] is None


def test_a_damaged_set_of_falls_is_refused(policy: str, falls: Path):
    whole = falls.read_bytes()
    for kept in (0, 100, -40):
        falls.write_bytes(whole[:kept])
        with pytest.raises(BadInputError, match=f"falls {falls}: it is"):
            evaluate(EvaluateRequest(policy=policy, n=4, falls=falls))


def test_every_four_falls_on_rough_ground_have_a_ground_of_their_own(policy: str):
    (rough,) = evaluate(EvaluateRequest(policy=policy, n=8, scene="rough:easy")).cases.values()
    assert rough.grounds == 2
    assert [row.n for row in rough.classes.values()] == [2, 2, 2, 2]


def test_falls_without_a_plan_follow_the_nearest_style_and_are_not_counted_as_planned(
    op3: Robot, monkeypatch: pytest.MonkeyPatch
):
    motion = next(m for m in load_database(op3).motions if m.name == "prone_push_up_fast")
    found = Plan(status=RiseStatus.STOOD, motion=motion)
    none = Plan(status=RiseStatus.NOT_PLANNED)
    plans = iter([found, none, none, found])
    monkeypatch.setattr(PlannedRise, "plan", lambda *_: next(plans))
    result = evaluate(EvaluateRequest(policy="styled", n=4, style="planned,nearest"))
    planned, nearest = json.loads(to_json(result))["cases"].values()
    assert planned["planned"] == 2
    assert "planned" not in nearest
    same = [planned["classes"][kind] == nearest["classes"][kind] for kind in CLASSES]
    assert same == [False, True, True, False]


@pytest.mark.scale
@pytest.mark.parametrize(("engine", "package"), [("local:2", "mujoco"), ("dask:2", "distributed")])
def test_rises_and_what_is_random_about_them_do_not_depend_on_the_workers(
    engine: str, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The policy is a file of the working directory, which a worker may not share."""
    pytest.importorskip(package)
    shutil.copy(REPOSITORY / "robots" / "op3" / "policies" / "robust.onnx", tmp_path / "mine.onnx")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(evaluation, "CHUNK", 4)  # two pieces of level ground
    done: dict[str, float] = {}

    def report(progress: Progress) -> None:
        assert progress.done >= done.get(progress.phase, 0.0)
        done[progress.phase] = progress.done

    some: dict[str, Any] = {"policy": "mine.onnx", "n": 8, "push": 0.3, "weak_servo": 0.7}
    some |= {"seed": 3, "scene": "flat,rough:easy"}
    here = evaluate(EvaluateRequest(engine="local:1", **some))
    there = evaluate(EvaluateRequest(engine=engine, **some), report)
    assert [case.all.n for case in here.cases.values()] == [8, 8]
    assert to_json(there) == to_json(here)
    for phase in ("falls (rough:easy)", "rises (flat)", "rises (rough:easy)"):
        assert done[phase] == pytest.approx(8.0)
