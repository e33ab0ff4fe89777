"""URDF files: what is mended is said, and what joints are tied to or can do is read."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from small_humanoid import small_urdf

from robots.model_import.importer import read_model
from robots.model_import.source import ActuatorFigures, ModelImportError, ModelSource
from robots.model_import.urdf import find_tree_problems, find_value_problems

STRUT = '<joint name="strut" type="fixed"><parent link="{}"/><child link="{}"/></joint></robot>'


@pytest.mark.parametrize(
    ("parent", "child", "message"),
    [
        ("left_foot", "unknown", "joint 'strut' joins 'left_foot' and 'unknown', expected two"),
        ("left_shank", "right_foot", "link 'right_foot' hangs on joints 'right_foot_joint' and "),
        ("head", "torso", "links 'torso', 'left_hip_yaw', "),
        ("head", "head", "link 'head' hangs on joints 'head_joint' and 'strut'"),
    ],
)
def test_a_joint_that_closes_a_loop_or_hangs_on_nothing_is_named(parent, child, message):
    root = ET.fromstring(small_urdf().replace("</robot>", STRUT.format(parent, child)))
    (problem,) = find_tree_problems(root)
    assert problem.startswith(message)


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
        ("1.5", "１", "value of <mass> is '１', expected a finite number"),
        ('ixx="1"', 'ixx="inf"', "ixx of <inertia> is 'inf', expected a finite number"),
        ('iyy="1"', 'iyy="1e30"', "has iyy of 1e+30 kg·m², expected at most 4500 kg·m²"),
        ('xyz="0 0 0"', 'xyz="0 0"', "xyz of <origin> is '0 0', expected 3 finite numbers"),
        ('lower="-1"', 'lower="-inf"', "joint 'hip': lower of <limit> is '-inf'"),
        ('effort="3"', 'effort="-3"', "has a limit of effort of -3 N·m, expected 0 N·m or more"),
        ('upper="2"', 'upper="-2"', "limits from -1 to -2 rad, expected the lower one first"),
        ('upper="2"', 'upper="90"', "has a limit of 90 rad, expected at most 12.6 rad"),
        ('joint="hip"', 'joint="tail"', "joint 'knee' mimics 'tail', expected another joint: hip"),
        ('joint="hip"', 'joint="knee"', "joint 'knee' mimics 'knee', expected another joint: hip"),
        ('name="hip" ', "", "joint 'knee' mimics 'hip', expected another joint"),
    ],
)
def test_a_number_that_cannot_be_is_refused(before: str, after: str, message: str):
    (problem,) = problems_of((before, after))
    assert message in problem


INERTIAL = (
    '<inertial><mass value="{mass}"/>'
    '<inertia ixx="{xx}" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial>'
)
BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def link(name: str, content: str) -> str:
    return f'<link name="{name}">{content}</link>'


def hinge(name: str, child: str, *, inside: str = "", kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="trunk"/><child link="{child}"/>'
        f'<axis xyz="0 1 0"/>{inside}</joint>'
    )


def read(folder: Path, *parts: str) -> ModelSource:
    trunk = link("trunk", INERTIAL.format(mass=1.0, xx="1e-3") + BOX)
    path = folder / "model.urdf"
    path.write_text(f'<robot name="r">{trunk}{"".join(parts)}</robot>')
    return read_model(path)


PAIR = [link(name, INERTIAL.format(mass=0.1, xx="1e-3")) for name in "ab"]
LIMIT = '<limit lower="-1" upper="1" effort="{effort}" velocity="{speed}"/>'


def test_limits_are_what_actuators_can_do_and_a_joint_that_mimics_has_none(tmp_path: Path):
    limits = [LIMIT.format(effort=effort, speed=speed) for effort, speed in ((3, 4), (0, 0))]
    hinges = [hinge(*each) for each in (("strong", "a"), ("silent", "b"))]
    hinges = [h.replace("</joint>", f"{x}</joint>") for h, x in zip(hinges, limits, strict=True)]
    source = read(tmp_path, *PAIR, *hinges)
    figures = ActuatorFigures(effort=3.0, speed=4.0)
    assert source.actuators == {"strong": figures, "silent": ActuatorFigures()}
    assert source.notes == ()
    mimic = '<limit/><mimic joint="strong" multiplier="-2"/>'
    source = read(tmp_path, *PAIR, hinges[0], hinge("tail", "b", inside=mimic))
    assert [*source.actuators] == ["strong"]
    (tie,) = source.ties
    assert (tie.joints, tie.shares) == (("tail", "strong"), (1.0, 2.0))


@pytest.mark.parametrize("moment", ["0", "-1e-3", "1e-15"])
def test_an_inertia_that_no_body_can_have_becomes_that_of_a_ball(tmp_path: Path, moment: str):
    heavy = link("a", INERTIAL.format(mass=0.5, xx=moment))
    source = read(tmp_path, heavy, hinge("hip", "a", inside="<limit/>"))
    radius = (3.0 * 0.5 / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
    assert source.model.body("a").inertia == pytest.approx([0.4 * 0.5 * radius**2] * 3, rel=1e-4)
    given = f"ixx {moment} ixy 0 ixz 0 iyy 1e-3 iyz 0 izz 1e-3"
    assert source.notes == (f"impossible inertias ({given}) are replaced by those of a ball: a",)


def test_products_of_inertia_are_not_mistaken_for_moments(tmp_path: Path):
    """Moments of 1 and a product of 0.9 on y and z are possible; of x and y they would be, too."""
    inertial = INERTIAL.format(mass=0.5, xx="1e-3").replace('iyz="0"', 'iyz="0.9e-3"')
    source = read(tmp_path, link("a", inertial), hinge("hip", "a", inside="<limit/>"))
    assert source.notes == ()
    wide = inertial.replace('iyz="0.9e-3"', 'iyz="1.1e-3"')  # |iyz| above the moments
    assert "ball" in read(tmp_path, link("a", wide), hinge("h", "a", inside="<limit/>")).notes[0]


@pytest.mark.parametrize("size", ["0.1 0.1 0", "0.1 -1 0.1"])
def test_a_shape_of_no_size_is_left_out(tmp_path: Path, size: str):
    flat = BOX.replace("0.1 0.1 0.1", size) + BOX
    leg = link("a", INERTIAL.format(mass=0.5, xx="1e-3") + flat)
    source = read(tmp_path, leg, hinge("hip", "a", inside="<limit/>"))
    assert source.model.ngeom == 2
    assert source.notes == (f"link a: a box of size {size} is left out, expected more than 0",)


@pytest.mark.parametrize(
    "parts",
    [
        (hinge("hip", "nowhere", inside="<limit/>"),),
        (link("a", BOX), hinge("hip", "a").replace('<parent link="trunk"/>', "")),
        (link("a", BOX), hinge("hip", "a"), hinge("hip", "a")),
        (link("a", BOX), link("a", BOX), hinge("hip", "a")),
        ('<joint type="revolute"/>',),
        (link("a", "<collision/>"), hinge("hip", "a", kind="spiral")),
    ],
)
def test_what_mujoco_refuses_is_reported_in_one_line(tmp_path: Path, parts: tuple[str, ...]):
    with pytest.raises(ModelImportError) as caught:
        read(tmp_path, *parts)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{tmp_path / 'model.urdf'}: ")
    assert "\n" not in problem
