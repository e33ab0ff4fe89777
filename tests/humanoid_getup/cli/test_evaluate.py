"""`getup eval`: figures by class for a policy, or one clear line."""

import json
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

pytest.importorskip("onnx")

from tiny_policies import save_policy

from humanoid_getup.cli.main import main
from humanoid_getup.cli.options.policies import Evaluate
from humanoid_getup.simulation.falls import CLASSES, Fall, FallSet
from robots import Robot
from sim2real.environment.model_variants import MODEL_VARIANTS


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


def test_all_that_is_wrong_is_told_at_once(policy: str, capsys: pytest.CaptureFixture[str]):
    assert main(("eval", policy, "--n", "5", "--delay", "90", "--voltage", "0.1")) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line == (
        "getup: --n is 5, expected a multiple of 4, 4 or more; "
        "--delay is 90 ms, expected 0 to 60 ms; --voltage is 0.1 V, expected 1 to 30 V"
    )


def test_too_few_falls_are_told(policy: str, falls: str, capsys: pytest.CaptureFixture[str]):
    assert main(("eval", policy, "--n", "12", "--falls", falls)) == 2
    assert "2 supine, 2 prone, 2 left, 2 right" in capsys.readouterr().err


def test_servos_that_are_no_motors_take_no_limits(falls: str, capsys: pytest.CaptureFixture[str]):
    servos = ("--n", "4", "--falls", falls, "--physics", "menagerie servos")
    assert main(("eval", "gentle", *servos)) == 2  # the policy asks for a part of the supply
    assert "a policy's own limit of the supply" in capsys.readouterr().err


@pytest.mark.parametrize("kept", [0, 100, -40])
def test_a_damaged_set_of_falls_is_refused_in_one_line(
    policy: str, falls: str, kept: int, capsys: pytest.CaptureFixture[str]
):
    Path(falls).write_bytes(Path(falls).read_bytes()[:kept])
    assert main(("eval", policy, "--n", "4", "--falls", falls)) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"falls {falls}: it is" in line


def test_the_model_variants_are_the_choices_of_the_option():
    literal, _ = get_args(get_type_hints(Evaluate)["physics"])
    assert get_args(literal) == tuple(MODEL_VARIANTS)


def test_falls_of_another_scene_are_refused(policy: str, falls: str, op3: Robot, capsys):
    moon = FallSet(robot="op3", scene="moon", seed=5, falls=FallSet.load(Path(falls), op3).falls)
    moon.save(Path(falls))
    assert main(("eval", policy, "--n", "4", "--falls", falls)) == 2
    assert "they are of scene 'moon', not 'flat'" in capsys.readouterr().err
