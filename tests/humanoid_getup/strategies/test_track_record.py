"""Records: read from the robot's folder, and what they promise."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.strategies.choice import (
    PLAN,
    POLICY,
    StandCount,
    StrategyId,
    load_track_record,
)
from robots import Robot, TorqueLimit, load_robot

ROBUST = StrategyId(POLICY, "robust")
TEXT = """
[[record]]
method = "plan"
torque_limit = 4.1
supine = { stood = 250, n = 250 }

[[record]]
method = "policy"
policy = "robust"
torque_limit = 4.1
supine = { stood = 248, n = 250 }
left = { stood = 4, n = 4 }

[[record]]
method = "policy"
policy = "robust"
torque_limit = 2.0
limit_by = "current"
supine = { stood = 170, n = 250 }

[[record]]
method = "policy"
policy = "robust"
torque_limit = 2.0
limit_by = "pwm"
supine = { stood = 120, n = 250 }
"""


def robot_with(text: str, folder: Path) -> Robot:
    (folder / "policies").mkdir()
    (folder / "policies" / "records.toml").write_text(text, "utf-8")
    return replace(load_robot("op3"), folder=folder)


def test_records_are_read_from_the_robots_folder(tmp_path: Path):
    records = load_track_record(robot_with(TEXT, tmp_path))
    assert [record.strategy for record in records.records] == [
        StrategyId(PLAN),
        ROBUST,
        ROBUST,
        ROBUST,
    ]
    assert records.records[1].counts == {"supine": StandCount(248, 250), "left": StandCount(4, 4)}
    assert records.knows(ROBUST)
    assert not records.knows(StrategyId(POLICY, "gentle"))


@pytest.mark.parametrize(
    ("torque_limit", "stood", "by"),
    [
        (5.0, 248, "current"),
        (3.0, 170, "current"),
        (2.0, 170, "current"),
        (1.9, None, "current"),
        (3.0, 120, "pwm"),
        (4.1, 248, "pwm"),
    ],
)
def test_what_counts_is_the_strongest_servo_not_stronger_than_mine(
    tmp_path: Path, torque_limit: float, stood: int | None, by: Any
):
    promised = load_track_record(robot_with(TEXT, tmp_path)).success(
        ROBUST, "supine", TorqueLimit(torque_limit, by)
    )
    assert promised == (0.0 if stood is None else wilson_interval(stood, 250)[0])


def test_all_that_is_wrong_is_reported_at_once(tmp_path: Path):
    text = """
[[record]]
method = "luck"
torque_limit = 0

[[record]]
method = "policy"
torque_limit = 2.0
limit_by = "hat"
supine = { stood = 9, n = 8 }
prone = 3
"""
    with pytest.raises(ValueError) as refusal:
        load_track_record(robot_with(text, tmp_path))
    for message in (
        "records.toml: record number 1: method is 'luck', expected plan, policy",
        "record number 1: torque_limit is 0",
        "record number 2: policy is missing",
        "record number 2: limit_by is 'hat', expected current, pwm, ideal",
        "record number 2: supine.stood is 9, expected an integer from 0 to 8",
        "record number 2: prone is 3, expected { stood = ..., n = ... }",
    ):
        assert message in str(refusal.value)
