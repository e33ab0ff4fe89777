"""The body in a clip: axes and limbs by hand, whichever axis points up."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanoid_getup.clips.clip import Clip
from humanoid_getup.motions.mocap.clip_body import ClipBody, read_body

# A body in its rest pose, z up, x forward [m]; the right side is its mirror image.
MIDDLE = {"Spine1": (0.0, 0.0, 1.1), "Neck": (0.0, 0.0, 1.45)}
LEFT = {
    "LeftUpLeg": (0.0, 0.1, 0.9),
    "LeftLeg": (0.0, 0.1, 0.5),
    "LeftFoot": (0.0, 0.1, 0.1),
    "LeftToeBase": (0.15, 0.1, 0.02),
    "LeftArm": (0.0, 0.2, 1.4),
    "LeftForeArm": (0.0, 0.5, 1.4),
    "LeftHand": (0.0, 0.75, 1.4),
}
REST = MIDDLE | LEFT | {n.replace("Left", "Right"): (x, -y, z) for n, (x, y, z) in LEFT.items()}


def make(turn: Rotation | None = None, **moved: tuple[float, float, float]) -> Clip:
    """Make a clip of one frame: the rest pose, turned, with some joints elsewhere."""
    turn = turn or Rotation.identity()
    places = {name: np.array(place) for name, place in (REST | moved).items()}
    return Clip(
        file=Path("own.bvh"),
        period=0.01,
        joints={name: turn.apply(place)[None] for name, place in places.items()},
        rest={name: np.array(place) for name, place in REST.items()},
        up="z",
    )


def lay_down(clip: Clip) -> Clip:
    """Express a clip in coordinates of which y points up."""

    def swap(rows: np.ndarray) -> np.ndarray:
        return rows[..., [0, 2, 1]] * [1.0, 1.0, -1.0]

    return replace(
        clip,
        joints={name: swap(rows) for name, rows in clip.joints.items()},
        rest={name: swap(row) for name, row in clip.rest.items()},
        up="y",
    )


def test_in_the_rest_pose_all_axes_are_those_of_the_world():
    body = read_body(make())
    for axes in (body.pelvis, body.torso, body.chest, body.limbs["left_leg"].foot):
        assert axes is not None
        assert axes[0] == pytest.approx(np.eye(3))
    assert body.hips[0] == pytest.approx([0.0, 0.0, 0.9])


@pytest.mark.parametrize("angles", [(40.0, 0.0, 0.0), (0.0, -80.0, 0.0), (10.0, 60.0, -30.0)])
def test_a_body_that_is_turned_is_turned_in_all_its_parts(angles):
    turn = Rotation.from_euler("zyx", angles, degrees=True)
    body, still = read_body(make(turn)), read_body(make())
    assert body.torso[0] == pytest.approx(turn.as_matrix())
    assert body.chest[0] == pytest.approx(turn.as_matrix())
    pose = body.limbs["right_leg"].pose(0, body.torso[0])
    own = still.limbs["right_leg"].pose(0, still.torso[0])
    assert pose.upper == pytest.approx(own.upper)
    assert pose.foot == pytest.approx(own.foot)


def describe(body: ClipBody) -> np.ndarray:
    tracks = [t for limb in body.limbs.values() for t in (limb.upper, limb.lower)]
    parts = [body.hips, body.pelvis, body.torso, body.chest, *tracks]
    return np.concatenate([part.ravel() for part in parts])


def test_it_does_not_matter_which_axis_points_up():
    clip = make(Rotation.from_euler("zyx", (30.0, -50.0, 10.0), degrees=True))
    own, other = (describe(read_body(each)) for each in (clip, lay_down(clip)))
    assert other == pytest.approx(own)


def test_a_body_without_hands_has_no_arms_and_one_without_toes_no_feet():
    clip = make()
    bare = {n: rows for n, rows in clip.joints.items() if "Hand" not in n and "Toe" not in n}
    body = read_body(replace(clip, joints=bare))
    assert set(body.limbs) == {"left_leg", "right_leg"}
    assert body.limbs["left_leg"].foot is None
