"""Scripts that get up many times: small runs, from the same falls in every way."""

import json
from pathlib import Path
from typing import Any

import compare_methods
import play_motions
import pytest
import rise_in_scenes
import sweep_designs
from rise_figures_of import drop_wall_times

from humanoid_getup.scenes.named_scenes import seed_grounds


def read(file: Path) -> dict[str, Any]:
    """Read figures without the wall times of plans."""
    return drop_wall_times(json.loads(file.read_text()))


@pytest.mark.slow
def test_methods_are_compared_by_processes_as_by_one(tmp_path: Path):
    for workers in (1, 2):
        options = {"ways": ("robust", "nearest"), "engine": f"local:{workers}"}
        file = tmp_path / f"{workers}.json"
        compare_methods.main(compare_methods.MethodOptions(n=4, seed=4, json=file, **options))
    here = read(tmp_path / "1.json")
    assert here == read(tmp_path / "2.json")
    assert (here["n"], list(here["cases"])) == (12, ["robust", "nearest"])
    heat = [case["hottest_after_ten_rises_c"]["median"] for case in here["cases"].values()]
    assert min(heat) > 25.0


@pytest.mark.slow
def test_every_way_rises_from_the_falls_of_a_scene(tmp_path: Path):
    file = tmp_path / "scenes.json"
    scenes, ways = ("beam", "rough:easy"), ("nearest", "straight")
    rise_in_scenes.main(rise_in_scenes.SceneOptions(n=2, scenes=scenes, ways=ways, json=file))
    result = read(file)
    assert list(result["cases"]) == [f"{scene}: {way}" for scene in scenes for way in ways]
    assert [rise["fall"] for rise in result["rises"]] == 2 * [0, 0, 1, 1]
    assert len({rise["start_class"] for rise in result["rises"][:4]}) == 1  # prone over a beam


@pytest.mark.slow
def test_falls_on_rough_ground_have_grounds_of_their_own(op3):
    falls = [*rise_in_scenes.list_scene_falls(op3, "rough:easy", 5, 3)]
    first, second = seed_grounds("rough:easy", 2, 3)
    assert [fall.ground for fall in falls] == [first, first, first, second, second]
    assert [fall.number for fall in falls] == [0, 1, 2, 3, 4]


@pytest.mark.slow
def test_a_motion_is_played_and_disturbed(tmp_path: Path):
    file, motions = tmp_path / "motions.json", ("prone_push_up_gentle",)
    play_motions.main(play_motions.MotionOptions(n=2, motions=motions, json=file))
    (case,) = read(file)["cases"].values()
    assert case["succeeded"]
    assert case["disturbed_succeeded"] == case["disturbed_n"] == 2


@pytest.mark.slow
def test_a_wider_sweep_takes_what_is_finished_from_the_ledger(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    def sweep(limits: str) -> dict[str, Any]:
        file, ledger = tmp_path / "sweep.json", tmp_path / "ledger.jsonl"
        picture = tmp_path / "sweep.png"
        files = {"json": file, "ledger": ledger, "picture": picture}
        options = {"torque_limit": limits, "ways": ("nearest",), "n": 1}
        sweep_designs.main(sweep_designs.SweepOptions(**options, **files))
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert len(ledger.read_text().splitlines()) == 1 + 4 * len(read(file)["cases"])
        return read(file)

    before, now = sweep("1.5:3.5:2"), sweep("1.5:3.5:1")
    assert "half stand" in capsys.readouterr().out
    assert now["axes"] == {"torque limit [N·m]": [1.5, 2.5, 3.5]}
    assert list(now["cases"]) == [f"{limit} N·m, flat, nearest" for limit in ("1.5", "2.5", "3.5")]
    assert {name: now["cases"][name] for name in before["cases"]} == before["cases"]


def test_a_design_that_cannot_be_had_is_refused_before_any_rise():
    for options, message in (
        ({"body": "arms=1.0:9.0:4.0"}, "arms is '5.0', expected a factor from 0.25 to 4"),
        ({"body": "wings=1.1"}, "unknown part 'wings', expected shoulders, arms, torso, legs"),
        ({"torque_limit": "3:1:1"}, "range is '3:1:1', expected a number, or FROM:TO:STEP"),
        ({"torque_limit": "99"}, "torque limit is 99 N·m, expected at most 4.1 N·m"),
        ({"servos": ("XL9",)}, "unknown servo 'XL9', expected"),
        ({"scenes": ("moon",)}, "unknown scene 'moon'"),
    ):
        with pytest.raises(ValueError, match=message):
            sweep_designs.main(sweep_designs.SweepOptions(n=1, **options))


def test_a_range_has_both_ends_and_half_stand_between_two_values():
    assert sweep_designs.parse_range("1.0:1.6:0.1") == [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6]
    assert sweep_designs.parse_range("2:2:1") == [2.0]
    assert sweep_designs.find_ends([(3.0, 1.0), (1.0, 0.0), (2.0, 0.25)]) == [(2.0, 3.0)]
