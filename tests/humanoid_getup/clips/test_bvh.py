"""BVH files: channels in any order, and files too large to be a clip of a body."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.clips import clip as clip_module
from humanoid_getup.clips.bvh import read_bvh

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


@pytest.mark.parametrize("turned", ["".join(order) for order in itertools.permutations("XYZ")])
def test_a_joint_turns_about_its_axes_in_the_order_of_its_channels(tmp_path: Path, turned: str):
    """The last channel turns first: each further one turns the frame of all that follow."""
    clip = read_bvh(write_arm(tmp_path / "arm.bvh", turned=turned))
    own = turn(turned[0]) @ turn(turned[1]) @ turn(turned[2])
    root = np.array([PLACE[axis] for axis in "XYZ"])
    assert clip.joints["a"][0] == pytest.approx(root)
    assert clip.joints["b"][0] == pytest.approx(root + own @ OFFSET)
    assert clip.joints["b end 0"][0] == pytest.approx(root + own @ OFFSET + own @ own @ OFFSET)
    assert clip.rest["b end 0"] == pytest.approx(2.0 * OFFSET)


@pytest.mark.parametrize("moved", ["".join(order) for order in itertools.permutations("XYZ")])
def test_a_joint_moves_along_the_axes_that_its_channels_name(tmp_path: Path, moved: str):
    clip = read_bvh(write_arm(tmp_path / "arm.bvh", moved=moved))
    assert clip.joints["a"][0] == pytest.approx([PLACE[axis] for axis in "XYZ"])


def test_a_file_of_too_many_bytes_is_refused_unread(tmp_path: Path):
    file = tmp_path / "huge.bvh"
    with file.open("wb") as stream:
        stream.truncate(clip_module.MOST_BYTES + 1)
    with pytest.raises(ValueError, match="more than 67108864 bytes"):
        read_bvh(file)
