"""URDF files: what is mended is said, and what joints are tied to or can do is read."""

from pathlib import Path

import numpy as np
import pytest

from robots.model_import.reading import read_model
from robots.model_import.source import ActuatorFigures, ModelImportError, ModelSource

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


LIMIT = '<limit lower="-1" upper="1" effort="{effort}" velocity="{speed}"/>'


def test_limits_are_what_actuators_can_do(tmp_path: Path):
    source = read(
        tmp_path,
        link("a", INERTIAL.format(mass=0.1, xx="1e-3")),
        link("b", INERTIAL.format(mass=0.1, xx="1e-3")),
        hinge("strong", "a", inside=LIMIT.format(effort=3, speed=4)),
        hinge("silent", "b", inside=LIMIT.format(effort=0, speed=0)),
    )
    assert source.actuators == {
        "strong": ActuatorFigures(effort=3.0, speed=4.0),
        "silent": ActuatorFigures(),
    }
    assert source.notes == ()


def test_a_joint_that_mimics_is_tied_and_has_no_actuator(tmp_path: Path):
    source = read(
        tmp_path,
        link("a", INERTIAL.format(mass=0.1, xx="1e-3")),
        link("b", INERTIAL.format(mass=0.1, xx="1e-3")),
        hinge("leader", "a", inside=LIMIT.format(effort=3, speed=4)),
        hinge("tail", "b", inside='<limit/><mimic joint="leader" multiplier="-2"/>'),
    )
    assert [*source.actuators] == ["leader"]
    (tie,) = source.ties
    assert (tie.joints, tie.shares) == (("tail", "leader"), (1.0, 2.0))


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
    ("parts", "message"),
    [
        ([link("a", BOX), link("b", BOX), hinge("hip", "a"), hinge("hip", "b")], "2 joints"),
        ([link("a", BOX), link("a", BOX), link("a", BOX), hinge("hip", "a")], "3 links"),
    ],
)
def test_names_that_stand_twice_are_reported(tmp_path: Path, parts: list[str], message: str):
    with pytest.raises(ModelImportError) as caught:
        read(tmp_path, *parts)
    name = "hip" if "joint" in message else "a"
    (problem,) = caught.value.problems
    assert problem == (
        f"{tmp_path / 'model.urdf'}: {message} are named '{name}', "
        "expected a name of its own for each"
    )


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
