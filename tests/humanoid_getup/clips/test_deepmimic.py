"""Motions of DeepMimic's humanoid as clips: their bones, real get-ups, and files that are none."""

import json
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.clips.clip import read_body
from humanoid_getup.clips.clip_file import read_clip
from humanoid_getup.style.curves import measure_clip

STILL = [0.02, 0.0, 0.9, 0.0, *[1, 0, 0, 0] * 3, *[1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0] * 2]


def write(file: Path, frames: object) -> Path:
    file.write_text(json.dumps({"Loop": "none", "Frames": frames}))
    return file


def test_the_body_stands_with_x_forward_and_z_to_the_right(tmp_path: Path):
    bent = [*STILL]
    bent[20] = -np.pi / 2  # right knee
    bent[0] = 0.0  # of the last frame
    clip = read_clip(write(tmp_path / "a.txt", [STILL, bent]))
    assert str(clip.layout) == "unit m, y up, rest pose: angles zero, sides: as named"
    assert clip.period == 0.02
    assert clip.joints["LeftUpLeg"][0] == pytest.approx([0.0, 0.084887, 0.9])
    assert clip.joints["RightFoot"][1] == pytest.approx([-0.40987, -0.084887, 0.9 - 0.421546])
    assert measure_clip(clip)[0] == pytest.approx([1.0, np.pi / 2, np.pi / 2])
    assert read_body(clip).torso[0] == pytest.approx(np.eye(3))


def test_a_frame_that_lasts_longer_is_followed_by_one_between(tmp_path: Path):
    long, moved = [*STILL], [*STILL]
    long[0], moved[1] = 0.04, 0.2
    clip = read_clip(write(tmp_path / "a.json", [STILL, long, moved, moved]))
    assert clip.joints["Hips"][:, 0] == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.2])


@pytest.mark.parametrize(
    ("frames", "fault"),
    [
        ([], "length >= 1"),
        ([STILL, STILL[1:]], "length >= 44 - at `$.Frames[1]`"),
        ([[*STILL[1:], "x"]], "Expected `float`, got `str`"),
        ([[*STILL[1:], float("nan")]], "invalid character"),
        ([[-1.0, *STILL[1:]]] * 2, "frame 1 lasts -1 s, expected 1e-06 to 1 s"),
        ([STILL, [*STILL[:8], 0, *STILL[9:]]], "frame 2 has a quaternion of length 0 for Spine"),
        ([[1e-6, *STILL[1:]]] * 3 + [[1.0, *STILL[1:]], STILL], "expected at most 6000000"),
        ([[1e308, *STILL[1:]]] * 3, "frame 1 lasts 1e+308 s, expected 1e-06 to 1 s"),
        ({"a": 1}, "Expected `array`"),
    ],
)
def test_a_file_that_is_none_is_refused_in_one_line(tmp_path: Path, frames, fault):
    file = write(tmp_path / "a.txt", frames)
    with pytest.raises(ValueError) as caught:
        read_clip(file)
    assert str(caught.value).startswith(f"clip {file}: ")
    assert fault in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "front"), [("facedown", 180.0), ("faceup", 0.0)])
def test_a_real_get_up_lies_first_and_stands_last(name: str, front: float):
    data = pytest.importorskip("pybullet_data", reason="needs the extra 'captures'")
    folder = Path(data.getDataPath()) / "data" / "motions"
    features = measure_clip(read_clip(folder / f"humanoid3d_getup_{name}.txt"))
    assert features[0, 0] < 0.25
    assert np.degrees(features[0, 2]) == pytest.approx(front, abs=40.0)
    assert features[-1, 0] > 0.85
