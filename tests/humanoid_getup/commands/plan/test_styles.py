"""`getup style`, and rises by a policy that follows a style."""

import json
from pathlib import Path

import numpy as np
import pytest
from run_getup import Run

pytest.importorskip("onnx")

from tiny_policies import save_styled_policy

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.plan.extract_style import ExtractRequest, extract_style
from humanoid_getup.experiments.falls import CLASSES, Fall, FallSet
from humanoid_getup.style.style import list_styles, load_style, read_style
from robots import Robot


@pytest.fixture
def policy(op3: Robot, tmp_path: Path) -> str:
    """A policy with style curves that stands still."""
    return str(save_styled_policy(tmp_path / "calm.onnx", op3))


def test_styles_are_listed_and_shown_with_their_curves(op3: Robot, run: Run):
    code, out, _ = run("style", "list", "--json", "-")
    assert code == 0
    styles = json.loads(out)["styles"]
    assert [style["name"] for style in styles] == list_styles()
    first = styles[4]["curves"][0]
    assert first["front_deg"][:3] == pytest.approx([15.3, 14.4, 46.9])
    assert first["duration_s"] == pytest.approx(load_style("sit-up", op3).curves[0].duration)
    code, out, _ = run("style", "show", "sit-up", "push-up", "--picture", "styles.png")
    assert code == 0
    assert "sit-up: sit up, roll over a hand" in out
    assert out.count("front_deg") == 6
    assert Path("styles.png").read_bytes().startswith(b"\x89PNG")


def test_styles_that_suit_a_fall_are_listed_first(run: Run):
    for start, first in (("supine", "long-sit"), ("prone", "push-up"), ("right", "long-sit")):
        styles = json.loads(run("style", "list", "--from", start, "--json", "-")[1])["styles"]
        assert (styles[0]["name"], styles[-1]["name"]) == (first, "half-kneel")
        assert start in styles[0]["followed_from"]
        assert styles[-1]["followed_from"] == []


def test_the_style_of_a_motion_is_that_of_its_frames(op3: Robot, tmp_path: Path):
    file = tmp_path / "rolled.toml"
    extract_style(ExtractRequest(source="supine_roll_over", out=file))
    (curve,) = read_style(file, op3).curves
    assert np.degrees(curve.values[0, 2]) < 20.0
    assert np.degrees(curve.front).max() > 150.0  # over on its face
    assert 90.0 < np.degrees(curve.side).max() < 170.0
    assert curve.values[-1, 0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.usefixtures("no_film")
def test_a_flight_shows_the_style_that_was_followed(op3, policy: str, run: Run, tmp_path: Path):
    wanted = ("--style", "side-sit", "--longest", "0.6", "--out", "run")
    assert run("run", policy, "--from", "left", *wanted)[0] == 1
    report = json.loads(Path("run/report.json").read_text())
    assert (report["policy"], report["style"], report["stood"]) == ("calm", "side-sit", False)
    log = tmp_path / "run" / "flight.mcap"
    guidance = FlightRecord.load(log, op3).tracks["guidance"]
    assert guidance["wanted"][0] == pytest.approx(guidance["measured"][0])
    assert np.ptp(guidance["wanted"][:, 0]) > 0.01
    assert run("replay", str(log), "--out", "replayed")[0] == 0
    assert "<h2>Style</h2>" in Path("replayed/replay.html").read_text()
    flown = Path("flown.toml")
    whole = ExtractRequest(source=str(log), begin=0.0, finish=True, out=flown)
    assert extract_style(whole).curves[0].values[0] == pytest.approx(
        guidance["measured"][0], abs=0.05
    )


def test_every_scene_and_style_is_a_case(op3: Robot, policy: str, run: Run, tmp_path: Path):
    falls = tuple(Fall(posture=op3.standing, start_class=kind) for kind in CLASSES)
    FallSet(robot="op3", scene="flat", seed=5, falls=falls).save(tmp_path / "falls.npz")
    wanted = ("--n", "4", "--falls", "falls.npz", "--style", "sit-up,nearest", "--json", "e.json")
    assert run("eval", policy, *wanted)[0] == 0
    cases = json.loads(Path("e.json").read_text())["cases"]
    assert list(cases) == ["flat, sit-up", "flat, nearest"]
    for case in cases.values():
        assert case["all"]["stood"] == 4  # they stood before
        assert case["all"]["stood_paper"] == case["all"]["followed"] == 4
        assert case["all"]["nearest"] == {"given": 4}
        assert case["all"]["height_error"]["median"] < 0.02  # at the end of their curves
        assert case["all"]["angle_error_deg"]["median"] < 3.0
