"""Clips by kind, and Acclaim files: bones, the angles of their joints, features of a real clip."""

import numpy as np
import pytest
from human_clips import write_human_bvh
from paths import SHARED

from humanoid_getup.clips.acclaim import INCH, read_acclaim
from humanoid_getup.clips.clip_file import read_clip
from humanoid_getup.style.curves import PLACES
from humanoid_getup.style.extraction import measure_clip

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
    """A BVH file points up along y unless said otherwise."""
    file = write_human_bvh(tmp_path / "a.BVH")
    assert [read_clip(file, None, None, up).up for up in (None, "z")] == ["y", "z"]
    amc, asf = tmp_path / "01_02.amc", tmp_path / "01.asf"
    amc.write_text(FRAMES_AMC)
    asf.write_text(SKELETON_ASF)
    clip = read_clip(amc, None, None, None)
    assert (clip.period, clip.up) == (1.0 / 120.0, "y")
    other = asf.rename(tmp_path / "other.asf")
    with pytest.raises(FileNotFoundError):
        read_clip(amc, None, None, None)
    named = read_clip(amc, other, 60.0, "z")
    assert (named.period, named.up) == (1.0 / 60.0, "z")


@pytest.mark.skipif(not CMU.exists(), reason="needs the clips in ../shared/mocap")
def test_features_of_a_real_clip_are_those_its_source_states():
    clip = read_acclaim(CMU / "140_03.amc", CMU / "140.asf")
    rising = measure_clip(clip)[120:781]
    sampled = np.array([np.interp(PLACES, np.linspace(0, 1, 661), column) for column in rising.T])
    front = [69, 42, 28, 58, 96, 75, 98, 120, 123]
    side = [159, 132, 112, 95, 99, 103, 104, 89, 97]
    assert np.degrees(sampled[2]) == pytest.approx(front, abs=0.6)
    assert np.degrees(sampled[1]) == pytest.approx(side, abs=0.6)
    neck = clip.unit * clip.joints["lowerneck"][120:781:660, 1] - 0.037
    assert neck == pytest.approx([0.15, 1.08], abs=0.005)
    assert clip.leg_length == pytest.approx(0.772, abs=0.001)


def turn(x: float, y: float, z: float) -> np.ndarray:
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
    root, frame = turn(10, 20, -30), turn(30, 40, 50)
    hip = root @ frame @ turn(15, 0, 25) @ frame.T  # its dof are rx and rz
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
