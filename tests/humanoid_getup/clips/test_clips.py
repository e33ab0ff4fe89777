"""Clips of motion capture, BVH and Acclaim: turns of joints, style features, what is refused."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from human_clips import write_human_bvh
from paths import SHARED

from humanoid_getup.clips.clip_file import INCH, read_acclaim, read_bvh, read_clip
from humanoid_getup.style.curves import PLACES, measure_clip

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
    clip = read_clip(write_bvh(tmp_path / "a.bvh", [(5, 100, 7, 0, 0, 0), (9, 100, 0, 0, 0, 40)]))
    assert measure_clip(clip) == pytest.approx(np.tile([1.0, *[math.pi / 2] * 2], (2, 1)))
    assert clip.time == pytest.approx([0.0, 0.05])
    assert clip.leg_length == pytest.approx(1.0)
    supine, left = (0, 10, 0, 0, -90, 0), (0, 10, 0, -90, 0, 0)
    features = measure_clip(read_clip(write_bvh(tmp_path / "a.bvh", [supine, left, left])))
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
        ("CHANNELS 6", "CHANNELS -2", "joint 'Hips' has -2 channels"),
        ("Yposition", "Yscale", "expected different ones of Xposition to Zposition"),
        ("Frame Time: 0.05", "Frame Time: 0", "a frame lasts 0 s, expected above 0 s"),
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
    with pytest.raises(ValueError) as caught:
        read_clip(file)
    assert str(caught.value) == (
        f"clip {file}: it has no neck, expected a joint lowerneck, Neck, neck, Neck1, NeckBase; it "
        "has Hips, LeftUpLeg, LeftFoot, RightUpLeg, RightFoot, Tail (--rename NAME=lowerneck "
        "renames one)"
    )
    assert measure_clip(read_clip(file, renames={"Tail": "Neck"}))[0, 0] == pytest.approx(1.0)


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


CMU = SHARED / "mocap" / "cmu"

SKELETON_ASF = """:units
  length 1.0
:bonedata
begin
  name hip
  direction 0 1 0
  length 2.0
  axis 0 0 0 XYZ
  dof rx rz
end
begin
  name foot
  direction 0 -1 0
  length 3.0
  axis 0 0 0 XYZ
end
:hierarchy
begin
  root hip
  hip foot
end
"""
REST = "1\nroot 0 0 0 0 0 0\n"
FRAMES_AMC = ":FULLY-SPECIFIED\n1\nroot 0 0 0 0 0 0\nhip 10 20\n2\nroot 0 1 0 0 0 0\nhip 0 0\n"


@pytest.mark.parametrize(
    ("before", "after", "fault"),
    [
        ("length 1.0", "length 0.0", "the unit of length is 0, expected above 0"),
        ("length 2.0", "length inf", "bone 'hip' has length inf"),
        ("direction 0 1 0", "direction 0 1", "bone 'hip' has direction 0 1, expected three"),
        ("dof rx rz", "dof r rz", "bone 'hip' has dof r rz, expected different ones of rx"),
        ("root hip", "root tail", "bone 'tail' is in the hierarchy, expected once"),
        ("  root hip\n", "", "bone 'hip' has children before it is one"),
        (":hierarchy", ":tree", "'hierarchy' is missing"),
        ("  axis 0 0 0 XYZ\n  dof", "  dof", "'axis' is missing"),
        ("axis 0 0 0 XYZ", "axis 0 0 0 ZYX", "has axis 0 0 0 ZYX, expected XYZ"),
    ],
)
def test_a_skeleton_that_is_damaged_is_refused_in_one_line(tmp_path, before, after, fault):
    clip, skeleton = tmp_path / "a.amc", tmp_path / "a.asf"
    clip.write_text(FRAMES_AMC)
    skeleton.write_text(SKELETON_ASF)
    assert read_acclaim(clip, skeleton).joints["foot end"][1] == pytest.approx([0.0, 0.0, 0.0])
    skeleton.write_text(SKELETON_ASF.replace(before, after, 1))
    with pytest.raises(ValueError) as caught:
        read_acclaim(clip, skeleton)
    assert str(caught.value).startswith(f"skeleton {skeleton}: it is not an ASF file: ")
    assert fault in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_clip_is_read_by_the_kind_of_its_file_with_the_skeleton_beside_it_or_named(tmp_path):
    assert read_clip(write_human_bvh(tmp_path / "a.BVH")).layout.unit_m == 0.01
    amc, asf = tmp_path / "01_02.amc", tmp_path / "01.asf"
    amc.write_text(FRAMES_AMC)
    asf.write_text(SKELETON_ASF)
    with pytest.raises(ValueError, match=r"01_02.amc: it has no left hip, .*; it has hip, foot"):
        read_clip(amc)
    other = asf.rename(tmp_path / "other.asf")
    with pytest.raises(FileNotFoundError):
        read_clip(amc)
    with pytest.raises(ValueError, match="it has no left hip"):
        read_clip(amc, other)
    assert [read_acclaim(amc, other, *rate).period for rate in ((), (60.0,))] == [1 / 120, 1 / 60]


@pytest.mark.skipif(not CMU.exists(), reason="needs the clips in ../shared/mocap")
def test_features_of_a_real_clip_are_those_its_source_states():
    clip = read_clip(CMU / "140_03.amc")
    rising = measure_clip(clip)[120:781]
    sampled = np.array([np.interp(PLACES, np.linspace(0, 1, 661), column) for column in rising.T])
    front = [69, 42, 28, 58, 96, 75, 98, 120, 123]
    side = [159, 132, 112, 95, 99, 103, 104, 89, 97]
    assert np.degrees(sampled[2]) == pytest.approx(front, abs=0.6)
    assert np.degrees(sampled[1]) == pytest.approx(side, abs=0.6)
    neck = clip.joints["lowerneck"][120:781:660, 2] - 0.037
    assert neck == pytest.approx([0.15, 1.08], abs=0.005)
    assert clip.leg_length == pytest.approx(0.772, abs=0.001)


def turn_by(x: float, y: float, z: float) -> np.ndarray:
    """Return the matrix of a turn about x, then y, then z [deg] of the fixed frame, written out."""
    (cx, sx), (cy, sy), (cz, sz) = ((np.cos(a), np.sin(a)) for a in np.radians([x, y, z]))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def test_a_bone_turns_about_the_axes_of_its_own_frame(tmp_path):
    clip, skeleton = tmp_path / "a.amc", tmp_path / "a.asf"
    skeleton.write_text(SKELETON_ASF.replace("axis 0 0 0", "axis 30 40 50", 1))
    clip.write_text("1\nroot 1 2 3 10 20 -30\nhip 15 25\n")
    root, frame = turn_by(10, 20, -30), turn_by(30, 40, 50)
    hip = root @ frame @ turn_by(15, 0, 25) @ frame.T  # its dof are rx and rz
    place = np.array([1, 2, 3]) + hip @ (2.0 * np.array([0, 1, 0]))
    read = read_acclaim(clip, skeleton)
    assert read.joints["foot"][0] == pytest.approx(place)
    assert read.joints["foot end"][0] == pytest.approx(place + hip @ (3.0 * np.array([0, -1, 0])))
    assert read.unit == INCH


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (f"{REST}hip 1 2\n2\nroot 0 0 0 0 0 0\n", "bone 'hip' has 1 frames, expected 2"),
        (f"{REST}hip 1\n", "bone 'hip': 1 numbers a frame, expected 2"),
        (f"{REST}hip 1 nan\n", "bone 'hip': number 2 of frame 1 is not finite"),
        (f"{REST}hip 1 two\n", "bone 'hip': could not convert"),
        (f"{REST}tail 1 2\n", "'tail' is missing"),
        ("1\nhip 1 2\n", "there is no root"),
    ],
)
def test_frames_that_are_damaged_are_refused_in_one_line(tmp_path, content: str, message: str):
    clip, skeleton = tmp_path / "a.amc", tmp_path / "a.asf"
    skeleton.write_text(SKELETON_ASF)
    clip.write_text(content)
    with pytest.raises(ValueError) as caught:
        read_acclaim(clip, skeleton)
    assert str(caught.value).startswith(f"clip {clip}: it is no AMC file of {skeleton}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
