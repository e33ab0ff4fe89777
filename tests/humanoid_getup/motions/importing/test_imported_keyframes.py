"""Keys from elsewhere become keyframes: in range, ending in the stance, from the right start."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from authored import load_robot_keyframes

from humanoid_getup.motions.imported_keyframes import (
    guess_start,
    load_key_table,
    load_sequences,
    make_keyframes,
)
from humanoid_getup.motions.key_files import KeyCollector
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.keyframes_writer import save_keyframes
from humanoid_getup.simulation.world import World
from robots import Robot

ANIMATION = {
    "name": "stand up/back",
    "author": "someone",
    "keyframes": [
        {"name": "a", "goals": {"l_knee": 20.0, "r_knee": -20}, "duration": 0.7, "pause": 0.2},
        {"goals": {"l_knee": 30.5}, "torque": {"l_el": 0, "r_el": 1}},
        {"goals": {}, "duration": 0.0, "stabilization_functions": {"l_knee": "x"}},
    ],
}


def load(path: Path, text: str, robot: Robot, *pages: int):
    path.write_text(text)
    (sequence,) = load_sequences(path, pages, robot)
    return sequence


def test_an_animation_holds_pauses_and_keeps_what_it_leaves_out(tmp_path: Path, op3: Robot):
    sequence = load(tmp_path / "up.json", json.dumps(ANIMATION), op3)
    knee, other = (op3.joint_names.index(f"{side}_knee") for side in "lr")
    np.testing.assert_allclose(np.degrees(sequence.keys[:, knee]), [20, 20, 30.5, 30.5])
    np.testing.assert_allclose(np.degrees(sequence.keys[:, other]), -20.0)
    # Held for 0.2 s; the default duration; no time is one control period.
    np.testing.assert_allclose(sequence.after, [0.2, 1.0, op3.control_period])
    elbow = op3.joint_names.index("l_el")
    assert (sequence.keys[:, elbow] == op3.standing.joint_pos[elbow]).all()
    assert sequence.notes == (
        "joints 'l_el' are released on the way: here they keep their targets",
        "its stabilization functions are left out",
    )
    made = make_keyframes(sequence, op3).keyframes
    assert made.name == "stand_up_back"
    save_keyframes(tmp_path / "keyframes.toml", [made], op3)
    (read,) = load_keyframes(tmp_path / "keyframes.toml", op3)
    assert read.free.tolist() == made.free.tolist()
    assert read.mirrored.tolist() == made.mirrored.tolist()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "time,l_knee\n", "no keys, expected a header and one row or more"),
        ("a.csv", "time,l_tail\n0,1\n", "unknown joint 'l_tail', expected r_sho_pitch"),
        ("a.csv", "l_knee\n0\n", "the header has 0 columns 'time', expected one"),
        ("a.csv", "time,l_knee,l_knee_deg\n0,1,1\n", "a joint has two columns"),
        ("a.csv", "time,l_knee\n0,1\n0,2\n", "row 2: time is 0 s, expected after 0 s of row 1"),
        ("a.csv", "time,l_knee\n0,soon\n", "row 1: l_knee is 'soon', expected a finite number"),
        ("a.csv", "time,l_knee\n0\n", "row 1 has 1 values, expected 2"),
        ("a.csv", "time,l_knee\n" + "0,0\n" * 200, "has 200 rows, expected at most 120"),
        ("a.json", "[]", "expected an object with keyframes"),
        ("a.json", "{}", "keyframes is missing, expected a list of tables, at least one"),
        ("a.json", '{"keyframes": [{"goals": {"LKnee": 1}}]}', "unknown joint 'LKnee'"),
        ("a.json", '{"keyframes": [{"goals": {"l_knee": "x"}}]}', "expected a finite angle"),
        ("a.json", '{"keyframes": [{"goals": {}, "duration": -1}]}', "expected 0 s or more"),
        ("a.txt", "anything", "a file of another kind, expected an action file (.bin), a JSON"),
    ],
)
def test_what_cannot_be_read_is_named(
    name: str, text: str, message: str, tmp_path: Path, op3: Robot
):
    with pytest.raises(ValueError) as refusal:
        load(tmp_path / name, text, op3)
    assert message in str(refusal.value)
    assert str(refusal.value).startswith(f"{tmp_path / name}: ")
    assert "\n" not in str(refusal.value)


def collect(robot: Robot, *degrees: float):
    collector = KeyCollector(robot=robot)
    for angle in degrees:
        collector.add(0.5, dict.fromkeys(range(robot.n), float(np.radians(angle))))
    return collector.finish("made", "a test")


def test_angles_out_of_range_are_refused_or_clipped_and_reported(tiny: Robot):
    sequence = collect(tiny, 0.0, -80.0, 70.0, 61.0)  # the hips go from -90 to 60 degrees
    with pytest.raises(ValueError, match="joint 'l_hip' of key number 3 is") as message:
        make_keyframes(sequence, tiny)
    assert "joint 'r_hip' of key number 3" in str(message.value)
    assert "--clip" in str(message.value)
    found = make_keyframes(sequence, tiny, clip=True)
    np.testing.assert_allclose(np.degrees(found.keyframes.keys[:, 0]), [0, -80, 60, 60, 0])
    assert len(found.notes) == 2


def test_keys_that_begin_in_the_stance_start_standing(op3: Robot, world: World):
    down = next(each for each in load_robot_keyframes(op3) if each.start_class == "standing")
    trial = guess_start(world, down)
    assert (trial.keyframes.start_class, trial.succeeded) == ("standing", True)
    assert trial.describe().startswith("lay supine after")


def write(folder: Path, *rows: str) -> Path:
    file = folder / "kneel.csv"
    file.write_text("\n".join(rows) + "\n")
    return file


def test_degrees_columns_in_another_order_and_a_later_clock_give_the_same_keys(
    tmp_path: Path, op3: Robot
):
    plain = load_key_table(write(tmp_path, "time,l_knee,r_knee", "0,0.5,-0.5", "0.7,1,-1"), op3)
    left, right = math.degrees(0.5), math.degrees(1.0)
    rows = [f"{-left!r}, {left!r}, 10", f"{-right!r}, {right!r}, 10.7"]
    again = load_key_table(write(tmp_path, "r_knee_deg, l_knee_deg, time", *rows), op3)
    np.testing.assert_allclose(again.keys, plain.keys)
    np.testing.assert_allclose(again.after, plain.after)
    assert (plain.name, plain.source) == ("kneel", "kneel.csv")
