"""Directions: along which way each link of a limb is long."""

from pathlib import Path

import numpy as np
import pytest
from tiny_robots import LEGS, build_skeleton, limb, make_robot

from robots import BodyError, Robot
from robots.quaternion import Array
from robots.reshaping.reshape_model import find_directions

DOWN, AHEAD = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])


def directions_of(robot: Robot, arm: bool = True) -> dict[str, Array]:
    skeleton = build_skeleton(robot)
    limbs = skeleton.parts.arms if arm else skeleton.parts.legs
    found = find_directions(skeleton, limbs[0][1])
    return {skeleton.root(link).name: direction for link, direction in found.items()}


def test_a_bracket_follows_the_long_link_below_it(tmp_path: Path):
    """Between two joints 5 mm apart, sideways, there is no direction of its own."""
    bracket = '<body name="bracket" pos="0 0 0.15"><joint name="turn" axis="0 0 1" range="-9 9"/>'
    bracket += f'<geom size="0.01" mass="0.01"/>{limb("arm", "0 0.005 0")}</body>'
    found = directions_of(make_robot(tmp_path, LEGS + bracket))
    assert found["bracket"] == pytest.approx(DOWN)


def test_a_foot_follows_the_shank(tmp_path: Path):
    foot = '<site name="{s}_sole" pos="0.02 0 -0.02"/>'
    legs = ""
    for side, y in (("l", "0.05"), ("r", "-0.05")):
        ankle = (
            f'<body name="{side}_foot" pos="0 0 -0.1"><joint name="{side}_ankle" axis="0 1 0" '
            f'range="-30 30"/><geom size="0.01" mass="0.01"/>{foot.format(s=side)}</body>'
        )
        legs += limb(f"{side}_hip", f"0 {y} 0", inside=ankle)
    found = directions_of(make_robot(tmp_path, legs), arm=False)
    assert found["l_foot"] == pytest.approx(DOWN)
    assert found["l_hip_link"] == pytest.approx(DOWN)


def test_a_direction_is_that_of_the_nearest_axis_of_its_shape(tmp_path: Path):
    """A forearm whose mass is a little in front of its axis is still long along its box."""
    ahead = limb("elbow", "0 0 -0.1", inside='<geom size="0.01" pos="0.02 0 -0.05" mass="0.05"/>')
    found = directions_of(make_robot(tmp_path, LEGS + limb("arm", "0 0 0.15", inside=ahead)))
    assert found["elbow_link"] == pytest.approx(DOWN)


def test_a_limb_of_no_length_is_refused(tmp_path: Path):
    ball = '<body name="ball" pos="0 0 0.2"><joint name="spin" axis="0 0 1" range="-9 9"/>'
    ball += '<geom size="0.01" mass="0.01"/></body>'
    with pytest.raises(BodyError, match="the limb 'ball' has no length"):
        directions_of(make_robot(tmp_path, LEGS + ball))
