"""Meshes of a URDF are found beside it or above, and links fall back on the shapes they have."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from text_meshes import write_text_stl

from robots.model_import import urdf_shapes
from robots.model_import.urdf_shapes import UrdfShapes, find_mesh


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The place of a model in a package; its meshes lie beside its folder."""
    (tmp_path / "robot" / "urdf").mkdir(parents=True)
    (tmp_path / "robot" / "meshes").mkdir()
    write_text_stl(tmp_path / "robot" / "meshes" / "Part.STL")
    return tmp_path / "robot" / "urdf" / "model.urdf"


@pytest.mark.parametrize(
    "name",
    [
        "../meshes/Part.STL",
        "meshes/Part.STL",
        "meshes/part.stl",
        "package://robot/meshes/Part.STL",
        "package://elsewhere/meshes/part.stl",
        "file://../meshes/Part.STL",
    ],
)
def test_a_mesh_is_found_by_any_of_its_names(model: Path, name: str):
    assert find_mesh(model, name) == (model.parent.parent / "meshes" / "Part.STL").resolve()


def shape(kind: str, content: str) -> str:
    return f"<{kind}><geometry>{content}</geometry></{kind}>"


def resolve(model: Path, *shapes: str) -> tuple[ET.Element, list[str], list[str]]:
    """Return the link that remains, the problems, and the notes."""
    root = ET.fromstring(f'<robot><link name="a">{"".join(shapes)}</link></robot>')
    notes: list[str] = []
    problems = UrdfShapes(model, root, notes).resolve()
    return root[0], problems, notes


PART, NONE = '<mesh filename="meshes/Part.STL"/>', '<mesh filename="none.stl"/>'


def test_shapes_that_collide_are_preferred(model: Path):
    link, problems, notes = resolve(model, shape("visual", PART), shape("collision", "<box/>"))
    assert ([part.tag for part in link], problems, notes) == (["collision"], [], [])


def test_those_for_the_eye_stand_in_where_meshes_are_missing(model: Path):
    link, problems, notes = resolve(model, shape("visual", PART), shape("collision", NONE))
    assert ([part.tag for part in link], problems) == (["visual"], [])
    assert "its visual shapes are used, as mesh 'none.stl'" in notes[0]
    assert next(link.iter("mesh")).get("filename") == "hull_0.stl"


def test_without_any_that_can_be_read_all_are_named(model: Path):
    _, problems, _ = resolve(model, shape("visual", NONE), shape("collision", NONE))
    assert len(problems) == 1
    assert "mesh 'none.stl' of link 'a' is not found" in problems[0]


def test_pointers_of_git_lfs_are_reported_in_one_line(model: Path):
    for name in ("one.stl", "two.dae"):
        (model.parent / name).write_text("version https://git-lfs.github.com/spec/v1\noid x\n")
    shapes = [shape("collision", f'<mesh filename="{name}"/>') for name in ("one.stl", "two.dae")]
    _, problems, _ = resolve(model, *shapes)
    assert problems == [
        f"{model}: mesh 'one.stl' is a Git LFS pointer, expected the file itself: "
        "run `git lfs pull`"
    ]


def test_meshes_that_are_too_large_together_are_refused(model: Path, monkeypatch):
    monkeypatch.setattr(urdf_shapes, "MAX_ASSETS", 100)
    _, problems, _ = resolve(model, shape("collision", PART))
    assert "with it all meshes have" in problems[0]
