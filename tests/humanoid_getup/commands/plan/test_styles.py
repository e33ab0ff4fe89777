"""`getup style`, and rises by a policy that follows a style."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

from tiny_policies import save_styled_policy

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.main import main
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, FallSet
from humanoid_getup.style.style_editor import rise_time
from humanoid_getup.style.style_file import list_styles, load_style, read_style
from robots import Robot

SHORT = ("--longest", "0.6")


@pytest.fixture
def policy(op3: Robot, tmp_path: Path) -> str:
    """A policy with style curves that stands still."""
    return str(save_styled_policy(tmp_path / "calm.onnx", op3))


def test_styles_are_listed_and_shown_with_their_curves(op3, tmp_path, capsys):
    out, picture = tmp_path / "styles.json", tmp_path / "styles.png"
    assert main(("style", "list", "--json", str(out))) == 0
    styles = json.loads(out.read_text())["styles"]
    assert [style["name"] for style in styles] == list_styles()
    capsys.readouterr()
    assert main(("style", "show", "sit-up", "push-up", "--picture", str(picture))) == 0
    shown = capsys.readouterr().out
    assert "sit-up: sit up, roll over a hand" in shown
    assert shown.count("front_deg") == 6
    assert picture.read_bytes().startswith(b"\x89PNG")
    first = styles[3]["curves"][0]
    assert first["front_deg"][:3] == pytest.approx([15.0, 20.0, 45.0])
    assert first["duration_s"] == pytest.approx(load_style("sit-up", op3).curves[0].duration)


def test_an_edit_moves_the_rise_as_asked_and_says_so(op3, tmp_path, capsys):
    file = tmp_path / "mine.toml"
    edit = ("style", "edit", "side-sit", "--slower", "1.5", "--later", "0.3", "--out", str(file))
    assert main(edit) == 0
    before, after = load_style("side-sit", op3), read_style(file, op3)
    for old, new in zip(before.curves, after.curves, strict=True):
        assert new.duration == pytest.approx(1.5 * old.duration, rel=1e-3)
        assert rise_time(new) == pytest.approx(1.5 * rise_time(old) + 0.3, abs=0.01)
    assert f"before: {before.curves[0].duration:.2f} s" in capsys.readouterr().out
    again = tmp_path / "again.toml"
    assert main(("style", "edit", str(file), "--faster", "1.5", "--out", str(again))) == 0
    assert read_style(again, op3).curves[0].duration == pytest.approx(
        before.curves[0].duration, rel=1e-3
    )


def test_the_style_of_a_motion_is_that_of_its_frames(op3, tmp_path):
    file = tmp_path / "rolled.toml"
    assert main(("style", "extract", "supine_roll_over", "--out", str(file))) == 0
    (curve,) = read_style(file, op3).curves
    assert np.degrees(curve.front[0]) < 20.0
    assert np.degrees(curve.front).max() > 150.0  # over on its face
    assert 90.0 < np.degrees(curve.side).max() < 170.0
    assert curve.neck_height[-1] == pytest.approx(1.0, abs=0.02)


@pytest.mark.usefixtures("no_film")
def test_a_flight_shows_the_style_that_was_followed(op3, policy, tmp_path):
    out, replayed = tmp_path / "run", tmp_path / "replayed"
    assert main(("run", policy, "--from", "left", "--style", "side-sit", *SHORT, "--out", str(out)))
    report = json.loads((out / "report.json").read_text())
    assert (report["policy"], report["style"], report["stood"]) == ("calm", "side-sit", False)
    log = out / "flight.mcap"
    guidance = FlightRecord.load(log, op3).tracks["guidance"]
    assert guidance["wanted"][0] == pytest.approx(guidance["measured"][0])
    assert np.ptp(guidance["wanted"][:, 0]) > 0.01
    assert main(("replay", str(log), "--out", str(replayed))) == 0
    assert (replayed / "style.png").read_bytes().startswith(b"\x89PNG")
    extracted = tmp_path / "flown.toml"
    whole = ("style", "extract", str(log), "--begin", "0", "--finish", "--out", str(extracted))
    assert main(whole) == 0
    (curve,) = read_style(extracted, op3).curves
    assert curve.points[0] == pytest.approx(guidance["measured"][0], abs=0.05)


def test_every_scene_and_style_is_a_case(op3, policy, tmp_path):
    out, file = tmp_path / "eval.json", tmp_path / "falls.npz"
    falls = tuple(Fall(posture=op3.standing, start_class=kind) for kind in CLASSES)
    FallSet(robot="op3", scene="flat", seed=5, falls=falls).save(file)
    styles = ("--style", "sit-up,nearest")
    evaluate = ("eval", policy, "--n", "4", "--falls", str(file), *styles, "--json", str(out))
    assert main(evaluate) == 0
    cases = json.loads(out.read_text())["cases"]
    assert list(cases) == ["flat, sit-up", "flat, nearest"]
    for case in cases.values():
        assert case["all"]["stood"] == 4  # they stood before
        assert case["all"]["height_error"]["median"] < 0.02  # at the end of their curves
        assert case["all"]["angle_error_deg"]["median"] < 3.0
