"""BVH clips of motion capture: channels in any order, their style features, and what is refused."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.clips import clip as clip_module
from humanoid_getup.clips.bvh import read_bvh
from humanoid_getup.style.extraction import measure_clip

TURN = "CHANNELS 3 Zrotation Xrotation Yrotation"
SKELETON_BVH = f"""HIERARCHY ROOT Hips {{ OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT LeftUpLeg {{ OFFSET 10 0 0 {TURN}
  JOINT LeftFoot {{ OFFSET 0 -100 0 {TURN} End Site {{ OFFSET 0 0 15 }} }} }}
JOINT RightUpLeg {{ OFFSET -10 0 0 {TURN}
  JOINT RightFoot {{ OFFSET 0 -100 0 {TURN} }} }}
JOINT Neck {{ OFFSET 0 50 0 {TURN} }} }}
MOTION
Frames: COUNT
Frame Time: 0.05
"""


def write_bvh(file, frames):
    rows = [" ".join(str(value) for value in [*frame, *[0.0] * 15]) for frame in frames]
    file.write_text(SKELETON_BVH.replace("COUNT", str(len(rows))) + "\n".join(rows) + "\n")
    return file


def test_a_body_that_stands_or_lies_shows_where_neck_front_and_side_are(tmp_path):
    clip = read_bvh(write_bvh(tmp_path / "a.bvh", [(5, 100, 7, 0, 0, 0), (9, 100, 0, 0, 0, 40)]))
    assert measure_clip(clip) == pytest.approx(np.tile([1.0, *[math.pi / 2] * 2], (2, 1)))
    assert clip.time == pytest.approx([0.0, 0.05])
    assert clip.leg_length == pytest.approx(1.0)
    supine, left = (0, 10, 0, 0, -90, 0), (0, 10, 0, -90, 0, 0)
    features = measure_clip(read_bvh(write_bvh(tmp_path / "a.bvh", [supine, left, left])))
    assert features[0, 1:] == pytest.approx([math.pi / 2, 0.0], abs=1e-6)
    assert features[1, 1:] == pytest.approx([0.0, math.pi / 2], abs=1e-6)
    assert features[0, 0] < 0.2


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        ("HIERARCHY", "HIERARCH", "HIERARCHY is missing"),
        ("Frames: 2", "Frames: 3", "it has 2 frames, expected 3 as it says"),
        ("OFFSET 10 0 0", "OFFSET 10 0 x", "could not convert"),
        ("MOTION", "MOTIONS LESS", "it is not a BVH file"),
        ("CHANNELS 6", "CHANGES 6", "unexpected 'CHANGES'"),
        ("CHANNELS 6", "CHANNELS -2", "joint 'Hips' has -2 channels"),
        ("Yposition", "Yscale", "expected different ones of Xposition to Zposition"),
        ("Yposition", "Xposition", "joint 'Hips' has 6 channels"),
        ("Frame Time: 0.05", "Frame Time: 0", "a frame lasts 0 s, expected above 0 s"),
        ("Frame Time: 0.05", "Frame Time: inf", "a frame lasts inf s"),
        ("0 100 0 0 0 0 0.0", "0 100 0 0 0 nan 0.0", "number 6 of frame 1 is not finite"),
        ("OFFSET 0 50 0", "OFFSET 0 inf 0", "joint 'Neck' has OFFSET"),
    ],
)
def test_a_file_that_is_no_bvh_is_refused_in_one_line(tmp_path, before, after, fault):
    file = write_bvh(tmp_path / "a.bvh", [(0, 100, 0, 0, 0, 0)] * 2)
    file.write_text(file.read_text().replace(before, after))
    with pytest.raises(ValueError) as caught:
        read_bvh(file)
    assert str(caught.value).startswith(f"clip {file}: ")
    assert fault in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_body_without_the_needed_joints_is_named(tmp_path):
    file = write_bvh(tmp_path / "a.bvh", [(0, 100, 0, 0, 0, 0)] * 2)
    file.write_text(file.read_text().replace("JOINT Neck", "JOINT Tail"))
    with pytest.raises(ValueError, match="it has no neck, expected a joint lowerneck, Neck"):
        measure_clip(read_bvh(file))


def test_a_body_that_does_not_stand_along_the_axis_up_is_refused(tmp_path):
    file = write_bvh(tmp_path / "a.bvh", [(0, 100, 0, 0, 0, 0)] * 2)
    clip = replace(read_bvh(file), up="z")
    for what, measure in (
        ("the middle of the hips", lambda: clip.leg_length),
        ("the neck", lambda: measure_clip(clip)),
    ):
        with pytest.raises(ValueError) as caught:
            measure()
        assert str(caught.value) == (
            f"clip {file}: in the rest pose {what} is 0 m over the feet along z, expected a "
            "stand; does y point up (--up y)?"
        )


OFFSET = np.array([1.0, 2.0, 3.0])
ANGLES = {"X": 20.0, "Y": 50.0, "Z": -70.0}
PLACE = {"X": 5.0, "Y": 6.0, "Z": 7.0}


def turn(axis: str) -> np.ndarray:
    """Return the matrix of a turn about an axis by its angle, written out."""
    c, s = np.cos(np.radians(ANGLES[axis])), np.sin(np.radians(ANGLES[axis]))
    rows = {
        "X": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "Y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "Z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return np.array(rows[axis], dtype=float)


def write_arm(path: Path, moved: str = "XYZ", turned: str = "ZXY", frames: int = 1) -> Path:
    """Write a root that moves and turns along axes in some orders, and what hangs on it."""
    channels = [f"{axis}position" for axis in moved] + [f"{axis}rotation" for axis in turned]
    numbers = [PLACE[axis] for axis in moved] + [ANGLES[axis] for axis in turned]
    x, y, z = OFFSET
    path.write_text(
        f"HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\nCHANNELS 6 {' '.join(channels)}\n"
        f"JOINT b\n{{\nOFFSET {x} {y} {z}\nCHANNELS 3 {' '.join(channels[3:])}\n"
        f"End Site\n{{\nOFFSET {x} {y} {z}\n}}\n}}\n}}\nMOTION\nFrames: {frames}\n"
        "Frame Time: 0.01\n" + f"{' '.join(map(str, numbers + numbers[3:]))}\n" * frames
    )
    return path


@pytest.mark.parametrize("order", ["".join(order) for order in itertools.permutations("XYZ")])
def test_a_joint_turns_and_moves_in_the_order_of_its_channels(tmp_path: Path, order: str):
    """The last channel turns first: each further one turns the frame of all that follow."""
    clip = read_bvh(write_arm(tmp_path / "arm.bvh", moved=order[::-1], turned=order))
    own = turn(order[0]) @ turn(order[1]) @ turn(order[2])
    root = np.array([PLACE[axis] for axis in "XYZ"])
    assert clip.joints["a"][0] == pytest.approx(root)
    assert clip.joints["b"][0] == pytest.approx(root + own @ OFFSET)
    assert clip.joints["b end 0"][0] == pytest.approx(root + own @ OFFSET + own @ own @ OFFSET)
    assert clip.rest["b end 0"] == pytest.approx(2.0 * OFFSET)


def test_a_file_of_too_many_bytes_is_refused_unread(tmp_path: Path):
    file = tmp_path / "huge.bvh"
    with file.open("wb") as stream:
        stream.truncate(clip_module.MOST_BYTES + 1)
    with pytest.raises(ValueError, match="more than 67108864 bytes"):
        read_bvh(file)
