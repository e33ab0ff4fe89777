import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import convert

from humanoid_getup.benchmarks.motions import MotionPiece, find_lowest_limit, measure_motion
from humanoid_getup.benchmarks.rise import RiseBench
from humanoid_getup.benchmarks.whole import SHARES, make_caps
from humanoid_getup.commands.main import main
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.motions.motion_database import load_database
from robots import Robot


@pytest.fixture
def one_motion(op3):
    return next(m for m in load_database(op3).motions if m.name == "prone_push_up_gentle")


def test_a_motion_is_played_and_disturbed(op3, world, one_motion):
    case = measure_motion(world, MotionPiece(motion=one_motion, number=0, seed=0, each=2))
    assert case.succeeded
    assert case.disturbed_n == 2
    assert case.disturbed_succeeded == 2  # a gentle motion bears what is drawn from this seed
    assert case.disturbed_interval_95 == wilson_interval(2, 2)
    assert case.peak_torque_nm <= op3.max_torque.max()
    assert case.lowest_torque_limit_nm <= 2.0
    still = one_motion.joint_target[:1].repeat(len(one_motion.time), axis=0)
    start = settle_posture(world, one_motion.posture(0))
    assert find_lowest_limit(world, replace(one_motion, joint_target=still), start) is None


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
