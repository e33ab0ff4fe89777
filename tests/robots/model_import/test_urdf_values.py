"""Numbers of a URDF: each is checked, and all problems come at once."""

import xml.etree.ElementTree as ET

import pytest

from robots.model_import.urdf_values import find_value_problems

URDF = """<robot name="r">
<link name="trunk"><inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="1.5"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<collision><geometry><box size="1 2 3"/></geometry></collision></link>
<link name="leg"><collision><geometry><mesh filename="a.stl" scale="1 1 1"/></geometry></collision>
</link>
<joint name="hip" type="revolute"><axis xyz="0 1 0"/>
<limit lower="-1" upper="2" effort="3" velocity="4"/></joint>
<joint name="knee" type="revolute"><limit lower="0" upper="2"/>
<mimic joint="hip" multiplier="2" offset="0"/></joint>
</robot>"""


def problems_of(*changes: tuple[str, str]) -> list[str]:
    text = URDF
    for before, after in changes:
        assert before in text
        text = text.replace(before, after, 1)
    return find_value_problems(ET.fromstring(text))


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("1.5", "nan", "link 'trunk': value of <mass> is 'nan', expected a finite number"),
        ("1.5", "-1", "link 'trunk' has a mass of -1 kg, expected 0 kg or more"),
        ("1.5", "1_5", "value of <mass> is '1_5', expected a finite number"),
        ("1.5", "１", "value of <mass> is '１', expected a finite number"),
        ("1.5", "", "value of <mass> is '', expected a finite number"),
        ('ixx="1"', 'ixx="inf"', "ixx of <inertia> is 'inf', expected a finite number"),
        ('iyy="1"', 'iyy="1e30"', "has iyy of 1e+30 kg·m², expected at most 4500 kg·m²"),
        ('xyz="0 0 0"', 'xyz="0 0"', "xyz of <origin> is '0 0', expected 3 finite numbers"),
        ("1 2 3", "1 2 x", "size of <box> is '1 2 x', expected 3 finite numbers"),
        ('"1 1 1"', '"1"', "scale of <mesh> is '1', expected 3 finite numbers"),
        ('lower="-1"', 'lower="-inf"', "joint 'hip': lower of <limit> is '-inf'"),
        ('effort="3"', 'effort="nan"', "joint 'hip': effort of <limit> is 'nan'"),
        ('effort="3"', 'effort="-3"', "has a limit of effort of -3 N·m, expected 0 N·m or more"),
        (
            'velocity="4"',
            'velocity="-4"',
            "velocity of -4 rad/s, expected 0 rad/s or more",
        ),
        ('upper="2"', 'upper="-2"', "limits from -1 to -2 rad, expected the lower one first"),
        ('upper="2"', 'upper="90"', "has a limit of 90 rad, expected at most 12.6 rad"),
        ('multiplier="2"', 'multiplier="nan"', "joint 'knee': multiplier of <mimic> is 'nan'"),
        ('joint="hip"', 'joint="tail"', "joint 'knee' mimics 'tail', expected another joint: hip"),
        ('joint="hip"', 'joint="knee"', "joint 'knee' mimics 'knee', expected another joint: hip"),
        ('joint="hip"', "", "joint 'knee' mimics None, expected another joint: hip"),
        ('name="hip" ', "", "joint 'knee' mimics 'hip', expected another joint"),
    ],
)
def test_a_number_that_cannot_be_is_refused(before: str, after: str, message: str):
    (problem,) = problems_of((before, after))
    assert message in problem


def test_all_problems_come_at_once():
    found = problems_of(("1.5", "-1"), ('effort="3"', 'effort="nan"'), ('joint="hip"', 'joint="a"'))
    assert [problem.split()[1].strip(":") for problem in found] == ["'trunk'", "'hip'", "'knee'"]
