"""A robot.toml as tables: defaults are filled in, and every contradiction is reported once."""

import tomllib
from collections.abc import Callable
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from paths import TINY

from robots import Robot
from robots.description.schema import MAIN_PORT, RobotTable, read_description
from robots.description.servo_catalog import servo_models

Toml = dict[str, Any]
Change = Callable[[Toml], object]
NUMBERS = st.floats(-3.0, 3.0)


TEXT = (TINY / "robot.toml").read_text("utf-8")


def read(change: Change = lambda _: None) -> tuple[RobotTable, list[str]]:
    """Read the description of the tiny robot with a change."""
    toml = tomllib.loads(TEXT)
    change(toml)
    return read_description(toml, servo_models())


def couple(*matrix: list[float]) -> Change:
    row = {"joints": ["l_hip", "r_hip"], "matrix": list(matrix)}
    return lambda toml: toml.setdefault("couplings", []).append(row)


def test_a_bus_without_ports_has_one_for_all_joints_and_the_board():
    table, _ = read()
    assert table.bus is not None
    assert table.bus.ports == {MAIN_PORT: ("l_hip", "r_hip")}
    assert table.bus.board is not None
    assert table.bus.board.port == MAIN_PORT


def test_a_joint_is_in_one_coupling_and_has_no_gear_there():
    def twice(toml: Toml) -> None:
        for _ in range(2):
            couple([1.0, 0.5], [0.5, 1.0])(toml)
        toml["joints"][0]["gear"] = 2.0

    _, problems = read(twice)
    assert problems == [
        "couplings: joint 'l_hip' is named 2 times, expected once",
        "couplings: joint 'r_hip' is named 2 times, expected once",
        "joint 'l_hip': gear is 2, expected none: it is in its coupling",
    ]


@given(row=st.tuples(NUMBERS, NUMBERS), share=NUMBERS)
def test_servos_that_turn_joints_in_one_ratio_are_no_coupling(row: tuple[float, float], share):
    _, problems = read(couple([*row], [share * each for each in row]))
    assert "expected independent rows" in problems[0]


def test_torque_is_limited_by_current_only_where_all_servos_sense_it(tiny: Robot):
    assert tiny.limit_by == "current"

    def mix(toml: Toml) -> None:
        toml["joints"][1]["servo"] = "XL430-W250"
        toml.update(limit_by="current", supply_voltage=12.0)

    _, problems = read(mix)
    assert problems == [
        'limit_by is "current", expected "pwm": the XL430-W250 of joint \'r_hip\' has no current '
        "sensor"
    ]
