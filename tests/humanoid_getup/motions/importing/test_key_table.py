"""Tables of keys: any order of columns, radians or degrees, times from anywhere."""

import math
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.motions.importing.key_table import load_key_table
from robots import Robot


def write(folder: Path, *rows: str) -> Path:
    file = folder / "kneel.csv"
    file.write_text("\n".join(rows) + "\n")
    return file


def test_degrees_columns_in_another_order_and_a_later_clock_give_the_same_keys(
    tmp_path: Path, op3: Robot
):
    plain = load_key_table(write(tmp_path, "time,l_knee,r_knee", "0,0.5,-0.5", "0.7,1,-1"), op3)
    left, right = math.degrees(0.5), math.degrees(1.0)
    other = write(
        tmp_path,
        "r_knee_deg, l_knee_deg, time",
        f"{-left!r}, {left!r}, 10",
        f"{-right!r}, {right!r}, 10.7",
    )
    again = load_key_table(other, op3)
    np.testing.assert_allclose(again.keys, plain.keys)
    np.testing.assert_allclose(again.after, plain.after)
    assert (plain.name, plain.source) == ("kneel", "kneel.csv")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ((), "no keys"),
        (("time,l_knee,time", "0,1,0"), "the header has 2 columns 'time', expected one"),
        (("time,l_tail_deg", "0,1"), "unknown joint 'l_tail_deg'"),
        (("time", "0"), "a joint has two columns or none has one"),
        (("time,l_knee", "1,0", "0.5,0"), "row 2: time is 0.5 s, expected after 1 s of row 1"),
        (("time,l_knee", "0,inf"), "row 1: l_knee is 'inf', expected a finite number"),
    ],
)
def test_a_damaged_table_is_refused_by_name_and_reason(tmp_path: Path, op3: Robot, rows, message):
    with pytest.raises(ValueError, match=f"kneel.csv: .*{message}"):
        load_key_table(write(tmp_path, *rows), op3)
