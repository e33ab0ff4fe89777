"""Postures and posture files."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import Posture
from robots.description.posture_file import format_posture, load_posture


def record(**changes):
    return {
        "position": [0.1, 0.2, 0.3],
        "orientation": [1.0, 0.0, 0.0, 0.0],
        "joint_pos": {"r_hip": -0.2, "l_hip": 0.1},
        **changes,
    }


def complaint(tmp_path, robot, text) -> str:
    path = tmp_path / "posture.json"
    path.write_text(text if isinstance(text, str) else json.dumps(text), "utf-8")
    with pytest.raises(ValueError) as caught:
        load_posture(path, robot)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


numbers = st.floats(-10.0, 10.0)


@given(
    position=st.tuples(numbers, numbers, numbers),
    joint_pos=st.tuples(st.floats(-1.5, 1.0), st.floats(-1.5, 1.0)),
)
def test_a_posture_survives_the_trip_through_its_file(tmp_path_factory, tiny, position, joint_pos):
    posture = Posture(
        position=np.array(position),
        orientation=np.array([0.5, -0.5, 0.5, 0.5]),
        joint_pos=np.array(joint_pos),
    )
    path = tmp_path_factory.getbasetemp() / "posture.json"
    path.write_text(format_posture(posture, tiny), "utf-8")
    again = load_posture(path, tiny)
    assert np.array_equal(again.position, posture.position)
    assert np.array_equal(again.joint_pos, posture.joint_pos)
    assert again.orientation == pytest.approx(posture.orientation)


def angles(l_hip, **others) -> dict:
    return {"joint_pos": {"l_hip": l_hip, "r_hip": 0, **others}}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"joint_pos": {"l_hip": 0.1}}, "joint 'r_hip' is missing"),
        (angles(0.1, tail=0), "unknown joint 'tail'"),
        (angles(0.1, r_hip=1.1), "'r_hip' is +1.100 rad, expected [-1.571, +1"),
        (angles(float("nan")), "joint_pos.l_hip is nan, expected a finite"),
        (angles("0.1"), "joint_pos.l_hip is '0.1', expected a finite"),
        (angles(10**400), "joint_pos.l_hip is inf, expected a finite"),
        (angles(1.0471976), "is +1.047197600 rad, expected [-1.5"),
        ({"orientation": [1.0, 1.0, 0.0, 0.0]}, "orientation has length 1.4142, expected 1"),
        ({"orientation": [1.0, 0.0, 0.0]}, "orientation is [1.0, 0.0, 0.0], expected a list of 4"),
        ({"position": [0.0, None, 0.0]}, "position[1] is None, expected a finite number (m)"),
        ({"position": [0.0, 1e9, 0.0]}, "position is 1e+09 m, expected at most 1000 m from the o"),
    ],
)
def test_a_wrong_posture_file_names_the_culprit_and_what_is_expected(
    tmp_path, tiny, changes, words
):
    assert words in complaint(tmp_path, tiny, record(**changes))


def test_all_that_is_wrong_is_reported_at_once(tmp_path, tiny):
    message = complaint(tmp_path, tiny, {"position": [0, 0], "joint_pos": {"tail": 0}})
    for words in ("position", "orientation", "'l_hip' is missing", "'r_hip' is missing", "'tail'"):
        assert words in message


def test_a_file_that_is_no_posture_is_refused(tmp_path, tiny):
    for text in ("", "{", "[1, 2]", "null"):
        assert "not " in complaint(tmp_path, tiny, text)
    with pytest.raises(ValueError, match=r"nothing\.json: No such file"):
        load_posture(tmp_path / "nothing.json", tiny)


def test_what_is_named_twice_is_refused(tmp_path, tiny):
    text = json.dumps(record())
    twice = text.replace('"r_hip"', '"l_hip": 0.1, "r_hip"')
    assert "'l_hip' is named 2 times, expected once" in complaint(tmp_path, tiny, twice)
    twice = text.replace('"position"', '"position": [0, 0, 0], "position"')
    assert "'position' is named 2 times, expected once" in complaint(tmp_path, tiny, twice)
