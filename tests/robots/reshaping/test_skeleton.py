"""The skeleton of a model: frames, anchors and bounds of links, by hand."""

from pathlib import Path

import numpy as np
import pytest
from tiny_robots import LEGS, build_skeleton, limb, make_robot

from robots.reshaping.skeleton import Skeleton


@pytest.fixture(scope="module")
def skeleton(tmp_path_factory: pytest.TempPathFactory) -> Skeleton:
    turned = limb("arm", '0 0.1 0.15" euler="0 90 0', inside=limb("elbow", "0 0 -0.1"))
    folder: Path = tmp_path_factory.mktemp("skeleton")
    return build_skeleton(make_robot(folder, LEGS + turned))


def test_anchors_are_given_in_the_frame_of_another_link(skeleton: Skeleton):
    """By hand: an arm that is turned by a right angle about y points back, to -x."""
    ((_, arm),) = skeleton.parts.arms
    (elbow,) = arm.children
    assert skeleton.anchor_in(arm, skeleton.torso) == pytest.approx([0.0, 0.1, 0.15])
    assert skeleton.anchor_in(elbow, arm) == pytest.approx([0.0, 0.0, -0.1])
    assert skeleton.anchor_in(elbow, skeleton.torso) == pytest.approx([-0.1, 0.1, 0.15])


def test_directions_go_from_frame_to_frame_and_back(skeleton: Skeleton):
    ((_, arm),) = skeleton.parts.arms
    down = np.array([0.0, 0.0, -1.0])
    in_torso = skeleton.turn(down, arm, skeleton.torso)
    assert in_torso == pytest.approx([-1.0, 0.0, 0.0])
    assert skeleton.turn(in_torso, skeleton.torso, arm) == pytest.approx(down)


def test_bounds_hold_a_links_shapes(skeleton: Skeleton):
    ((_, arm),) = skeleton.parts.arms
    own = [[-0.03, -0.02, -0.1], [0.03, 0.02, 0.0]]
    assert skeleton.bounds(arm, arm) == pytest.approx(np.array(own))
    turned = [[-0.1, 0.08, 0.12], [0.0, 0.12, 0.18]]
    assert skeleton.bounds(arm, skeleton.torso) == pytest.approx(np.array(turned))


def test_a_foot_has_its_sole(skeleton: Skeleton):
    (_, leg), _ = skeleton.parts.legs
    (foot,) = leg.children
    assert skeleton.has_sole(foot)
    assert not skeleton.has_sole(leg)
    assert skeleton.sole(foot) == pytest.approx([0.0, 0.0, -0.1])
