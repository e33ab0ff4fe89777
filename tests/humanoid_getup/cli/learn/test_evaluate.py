"""`getup eval`: figures by class for a policy, or one clear line."""

import json
from pathlib import Path

import pytest

pytest.importorskip("onnx")

from tiny_policies import save_policy

from humanoid_getup.commands.main import main
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, FallSet
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot


@pytest.fixture
def policy(op3: Robot, tmp_path: Path) -> str:
    """A policy that does nothing."""
    return str(save_policy(tmp_path / "idle.onnx", op3))


@pytest.fixture
def falls(op3: Robot, tmp_path: Path) -> str:
    """ "Falls" that stand, so that doing nothing is right."""
    file = tmp_path / "falls.npz"
    falls = tuple(Fall(posture=op3.standing, start_class=kind) for kind in CLASSES * 2)
    FallSet(robot="op3", scene="flat", seed=5, falls=falls).save(file)
    return str(file)


def test_eval_counts_every_class(policy: str, falls: str, tmp_path: Path):
    out = tmp_path / "eval.json"
    arguments = ("eval", policy, "--n", "4", "--falls", falls, "--delay", "20", "--json", str(out))
    assert main(arguments) == 0
    figures = json.loads(out.read_text())
    assert (figures["name"], figures["policy"], figures["n"]) == ("eval", "idle", 4)
    (case,) = figures["cases"].values()
    assert (figures["trial"], case["falls_seed"]) == ("delay 0.02 s", 5)
    for kind in CLASSES:
        assert (case["classes"][kind]["n"], case["classes"][kind]["stood"]) == (1, 1)
    assert case["all"]["stood"] == 4
    assert (case["scene"], case["style"], case["all"]["height_error"]["median"]) == (
        "flat",
        None,
        None,
    )


@pytest.mark.parametrize("kept", [0, 100, -40])
def test_a_damaged_set_of_falls_is_refused_in_one_line(
    policy: str, falls: str, kept: int, capsys: pytest.CaptureFixture[str]
):
    Path(falls).write_bytes(Path(falls).read_bytes()[:kept])
    assert main(("eval", policy, "--n", "4", "--falls", falls)) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"falls {falls}: it is" in line


def test_every_four_falls_on_rough_ground_have_a_ground_of_their_own(policy, tmp_path):
    file = tmp_path / "rough.json"
    command = ("eval", policy, "--n", "8", "--scene", "flat,rough:easy", "--json", str(file))
    assert main(command) == 0
    flat, rough = json.loads(file.read_text())["cases"].values()
    assert (flat["grounds"], rough["grounds"]) == (1, 2)
    assert [row["n"] for row in rough["classes"].values()] == [2, 2, 2, 2]


def test_falls_without_a_plan_follow_the_nearest_style_and_are_not_counted_as_planned(
    op3, tmp_path, monkeypatch
):
    file = tmp_path / "planned.json"
    motion = next(m for m in load_database(op3).motions if m.name == "prone_push_up_fast")
    found = MotionPlan(status=RiseStatus.STOOD, motion=motion)
    plans = iter([found, RisePlan(status=RiseStatus.NOT_PLANNED), None, found])
    monkeypatch.setattr(PlannedRise, "plan", lambda *_: next(plans))
    command = ("eval", "styled", "--n", "4", "--style", "planned,nearest", "--json", str(file))
    assert main(command) == 0
    planned, nearest = json.loads(file.read_text())["cases"].values()
    assert planned["planned"] == 2
    assert "planned" not in nearest
    same = [planned["classes"][kind] == nearest["classes"][kind] for kind in CLASSES]
    assert same == [False, True, True, False]
