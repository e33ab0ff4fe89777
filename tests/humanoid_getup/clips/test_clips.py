"""Clips of motion capture are read for their style features."""

import math
from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.clips.bvh import read_bvh
from humanoid_getup.style.extraction import measure_clip

# A body of one meter to the hips, 50 cm from there to the neck; y is up, z is forward.
SKELETON_BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 10 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftFoot
    {
      OFFSET 0 -100 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 0 15
      }
    }
  }
  JOINT RightUpLeg
  {
    OFFSET -10 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT RightFoot
    {
      OFFSET 0 -100 0
      CHANNELS 3 Zrotation Xrotation Yrotation
    }
  }
  JOINT Neck
  {
    OFFSET 0 50 0
    CHANNELS 3 Zrotation Xrotation Yrotation
  }
}
MOTION
Frames: {count}
Frame Time: 0.05
"""


def write_bvh(file, frames):
    rows = [" ".join(str(value) for value in [*frame, *[0.0] * 15]) for frame in frames]
    file.write_text(SKELETON_BVH.replace("{count}", str(len(rows))) + "\n".join(rows) + "\n")
    return file


def test_a_body_that_stands_has_its_neck_at_one_and_a_torso_upright(tmp_path):
    clip = read_bvh(write_bvh(tmp_path / "a.bvh", [(5, 100, 7, 0, 0, 0), (9, 100, 0, 0, 0, 40)]))
    assert measure_clip(clip) == pytest.approx(np.tile([1.0, *[math.pi / 2] * 2], (2, 1)))
    assert clip.time == pytest.approx([0.0, 0.05])
    assert clip.leg_length == pytest.approx(1.0)


def test_a_body_that_lies_shows_where_its_front_and_side_point(tmp_path):
    supine, left = (0, 10, 0, 0, -90, 0), (0, 10, 0, -90, 0, 0)
    clip = read_bvh(write_bvh(tmp_path / "a.bvh", [supine, left, left]))
    features = measure_clip(clip)
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
