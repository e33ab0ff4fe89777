"""A clip is read by the kind of its file, with the skeleton beside it."""

from pathlib import Path

import pytest
from human_clips import write_human_bvh

from humanoid_getup.clips.clip_file import read_clip

SKELETON = """:units
length 1.0
:bonedata
begin
name hip
direction 0 1 0
length 2.0
axis 0 0 0 XYZ
dof rx
end
:hierarchy
begin
root hip
end
"""
FRAMES = "1\nroot 0 0 0 0 0 0\nhip 10\n"


def test_a_bvh_file_points_up_along_y_unless_said_otherwise(tmp_path: Path):
    file = write_human_bvh(tmp_path / "a.BVH")
    assert read_clip(file, None, None, None).up == "y"
    assert read_clip(file, None, None, "z").up == "z"


def test_a_skeleton_lies_beside_its_clip_or_is_named(tmp_path: Path):
    (tmp_path / "01_02.amc").write_text(FRAMES)
    (tmp_path / "01.asf").write_text(SKELETON)
    clip = read_clip(tmp_path / "01_02.amc", None, None, None)
    assert (clip.period, clip.up) == (1.0 / 120.0, "y")
    (tmp_path / "01.asf").rename(tmp_path / "other.asf")
    with pytest.raises(FileNotFoundError):
        read_clip(tmp_path / "01_02.amc", None, None, None)
    named = read_clip(tmp_path / "01_02.amc", tmp_path / "other.asf", 60.0, "z")
    assert (named.period, named.up) == (1.0 / 60.0, "z")
