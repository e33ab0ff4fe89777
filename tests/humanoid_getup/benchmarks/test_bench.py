import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import convert

from humanoid_getup.benchmarks.rise import RiseBench
from humanoid_getup.benchmarks.whole import SHARES, make_caps
from humanoid_getup.commands.main import main
from robots import Robot


def with_stall(robot, stall):
    joints = [
        replace(j, servo=replace(j.servo, model=replace(j.servo.model, stall_torque=stall)))
        for j in robot.joints
    ]
    return replace(robot, joints=tuple(joints))


def test_the_command_writes_what_it_ran_with(tmp_path: Path):
    file = tmp_path / "rise.json"
    limit = ("--torque-limit", "3", "--limit-by", "pwm", "--no-planning", "--no-filtering")
    assert main(("bench", "rise", "--n", "1", "--seed", "4", *limit, "--json", str(file))) == 0
    result = json.loads(file.read_text())
    assert (result["name"], result["n"], result["torque_limit_nm"]) == ("rise", 3, 3.0)
    assert result["limit_by"] == "pwm"
    assert (result["planning"], result["filtering"]) == (False, False)
    assert result["all"]["planned"] == 0
    assert [rise["bench_class"] for rise in result["rises"]] == ["supine", "prone", "lateral"]
    assert result["all"]["stood"] == sum(rise["stood"] for rise in result["rises"])
    classes = convert(result, RiseBench).classes
    assert {name: summary.n for name, summary in classes.items()} == {
        "supine": 1,
        "prone": 1,
        "lateral": 1,
    }


def test_the_caps_of_op3_are_those_of_the_other_benchmarks(op3: Robot):
    caps = make_caps(op3)
    assert [cap.limit.value for cap in caps] == [None, 2.99, 2.5, 2.01]
    assert [cap.name for cap in caps] == ["stall torque", "73%", "61%", "49%"]
    assert {cap.limit.by for cap in caps} == {op3.limit_by}


@given(stall=st.floats(0.1, 50.0), by=st.sampled_from(["current", "pwm", "ideal"]))
def test_a_cap_is_the_share_that_it_says_of_any_servo(tiny: Robot, stall: float, by):
    caps = make_caps(with_stall(tiny, stall), by)
    assert caps[0].limit.value is None
    for cap, share in zip(caps[1:], SHARES[1:], strict=True):
        assert cap.limit.value == pytest.approx(share * stall, rel=0.005)
        assert cap.limit.by == by


def test_a_gear_counts_where_the_torque_acts(geared: Robot):
    strongest = float(geared.max_torque.max())
    assert strongest > 4.1
    assert make_caps(geared)[-1].limit.value == pytest.approx(0.49 * strongest, rel=0.005)
