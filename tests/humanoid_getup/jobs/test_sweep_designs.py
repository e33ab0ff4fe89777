"""A sweep gets up with every design, says where one stops, and goes on where it ended."""

import json
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from humanoid_getup.benchmarks.sweep.design import Design
from humanoid_getup.benchmarks.sweep.swept_design import SweptDesign, find_ends, list_axes
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.sweep import SweepRequest, parse_range
from humanoid_getup.jobs.sweep_designs import sweep
from humanoid_getup.progress.callback import CancelledError
from robots import load_robot
from robots.description.other_servos import use_servos

PNG = b"\x89PNG"
FAST: dict[str, Any] = {"ways": ("nearest",), "n": 1, "engine": "local:1"}


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sweep two torque limits."""
    out = tmp_path_factory.mktemp("sweep")
    sweep(SweepRequest(out=out, torque_limit="1.5:3.5:2", **FAST))
    return out


def test_a_page_a_plot_and_figures_are_written(swept: Path):
    page = (swept / "sweep.md").read_text()
    assert "| 1.5 N·m, flat, nearest |" in page
    assert "Where it stops getting up" in page
    assert "getup sweep --torque-limit 1.5:3.5:2 --ways nearest --n 1" in page
    assert (swept / "sweep.png").read_bytes().startswith(PNG)
    figures = json.loads((swept / "sweep.json").read_text())
    assert figures["axes"] == {"torque limit [N·m]": [1.5, 3.5]}
    assert [one["n"] for one in figures["cases"].values()] == [4, 4]
    assert set(figures["versions"]) == {"program", "libraries", "robot"}


def test_a_wider_sweep_takes_what_is_finished_from_the_ledger(swept: Path, tmp_path: Path):
    before = json.loads((swept / "sweep.json").read_text())["cases"]
    (tmp_path / "sweep.jsonl").write_bytes((swept / "sweep.jsonl").read_bytes())
    messages = list[str]()
    wider = SweepRequest(out=tmp_path, torque_limit="1.5:3.5:1", resume=True, **FAST)
    result = sweep(wider, lambda progress: messages.append(progress.message))
    assert "8 of 12 classes are finished" in messages
    now = json.loads((tmp_path / "sweep.json").read_text())["cases"]
    assert list(now) == [f"{limit} N·m, flat, nearest" for limit in ("1.5", "2.5", "3.5")]
    assert {name: now[name] for name in before} == before
    assert len(result.cases) == 3


def test_a_canceled_sweep_keeps_what_is_finished_and_writes_no_page(tmp_path: Path):
    done = list[float]()
    with pytest.raises(CancelledError):
        sweep(
            SweepRequest(out=tmp_path, torque_limit="3.5", **FAST),
            lambda progress: done.append(progress.done),
            lambda: 1.0 in done,
        )
    assert len((tmp_path / "sweep.jsonl").read_text().splitlines()) == 1 + 1
    assert not (tmp_path / "sweep.md").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"body": "arms=1.0:9.0:4.0"}, "arms is '5.0', expected a factor from 0.25 to 4"),
        ({"body": "wings=1.1"}, "unknown part 'wings', expected shoulders, arms, torso, legs"),
        ({"body": "arms"}, "--body is 'arms', expected PART=FACTOR or PART=FROM:TO:STEP"),
        ({"body": "arms=1,arms=2"}, "--body names arms twice"),
        ({"torque_limit": "3:1:1"}, "--torque-limit is '3:1:1', expected a step above 0"),
        ({"torque_limit": "1:2"}, "--torque-limit is '1:2', expected a number, or a range"),
        ({"torque_limit": "0:1:0.5"}, "torque limit is 0 N·m, expected a finite number above 0"),
        ({"torque_limit": "99"}, "torque limit is 99 N·m, expected at most 4.1 N·m"),
        (
            {"torque_limit": "1:2:1e-6"},
            "--torque-limit is '1:2:1e-6', expected at most 1000 values",
        ),
        ({"torque_limit": "-1e308:1e308:1"}, "expected at most 1000 values"),
        ({"torque_limit": "0:1e10:1e-320"}, "expected at most 1000 values"),
        (
            {"body": ",".join(f"{part}=1:2:0.002" for part in ("arms", "legs", "torso"))},
            "the ranges are 125751501 designs, expected at most 100000",
        ),
        ({"servos": ("XL9",)}, "unknown servo 'XL9', expected"),
        ({"scenes": ("moon",)}, "unknown scene 'moon'"),
        ({"ways": ("fly",)}, "fly"),
    ],
)
def test_a_design_that_cannot_be_had_is_refused_before_any_rise(
    options: dict[str, Any], message: str, tmp_path: Path
):
    with pytest.raises(BadInputError, match=message):
        sweep(SweepRequest(out=tmp_path, **{**FAST, **options}))
    assert not [*tmp_path.iterdir()]


def test_a_range_has_both_ends():
    assert parse_range("1.0:1.6:0.1") == [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6]
    assert parse_range("2:2:1") == [2.0]
    assert parse_range("0.5") == [0.5]


def test_the_end_is_between_the_values_where_half_stand_and_do_not():
    cases = [make_design(limit, stood) for limit, stood in ((3.0, 4), (1.0, 0), (2.0, 1))]
    assert find_ends(cases, "torque limit [N·m]") == [(2.0, 3.0)]
    assert list_axes(cases) == {"torque limit [N·m]": [3.0, 1.0, 2.0]}


def make_design(limit: float, stood: int) -> SweptDesign:
    """Make a design of which some of four rises stood."""
    design = SweptDesign.join(Design(torque_limit=limit), {})
    return structs.replace(design, n=4, stood=stood)


def test_other_servos_have_their_own_torque_and_supply():
    robot = load_robot("op3")
    other = use_servos(robot, "XL330-M288")
    assert other.max_torque.max() < 0.2 * robot.max_torque.max()
    assert other.supply_voltage == 5.0
    assert other.supply_range[0] <= other.supply_voltage <= other.supply_range[1]
    assert use_servos(robot, robot.joints[0].servo.model.name).joints == robot.joints
