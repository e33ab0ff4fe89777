"""Joints of a URDF make a tree, or what is wrong with them is said in a line each."""

import xml.etree.ElementTree as ET

import pytest
from small_humanoid import small_urdf

from robots.model_import.urdf_tree import find_tree_problems

STRUT = '<joint name="strut" type="fixed"><parent link="{}"/><child link="{}"/></joint></robot>'


@pytest.mark.parametrize(
    ("parent", "child", "messages"),
    [
        (
            "left_foot",
            "unknown",
            ["joint 'strut' joins 'left_foot' and 'unknown', expected two links"],
        ),
        (
            "left_shank",
            "right_foot",
            ["link 'right_foot' hangs on joints 'right_foot_joint' and 'strut', expected one"],
        ),
        ("head", "torso", ["links 'torso', 'left_hip_yaw', "]),
        ("head", "head", ["link 'head' hangs on joints 'head_joint' and 'strut'"]),
    ],
)
def test_a_joint_that_closes_a_loop_or_hangs_on_nothing_is_named(parent, child, messages):
    root = ET.fromstring(small_urdf().replace("</robot>", STRUT.format(parent, child)))
    problems = [*find_tree_problems(root)]
    assert [p[: len(m)] for p, m in zip(problems, messages, strict=True)] == messages
