"""Meshes of a URDF are found beside it or above, and links fall back on the shapes they have."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from text_meshes import write_text_stl

from robots.model_import import urdf_shapes
from robots.model_import.urdf_shapes import UrdfShapes, find_mesh
from robots.storage.model_files import MAX_ASSET


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


def test_a_mesh_may_be_named_by_its_place_on_the_disk(model: Path):
    file = model.parent.parent / "meshes" / "Part.STL"
    assert find_mesh(model, str(file)) == file.resolve()
    assert find_mesh(model, f"file://{file}") == file.resolve()


@pytest.mark.parametrize("name", ["", "none.stl", "meshes", "..", "x" * 300, "package://"])
def test_what_is_no_file_is_not_found(model: Path, name: str):
    assert find_mesh(model, name) is None


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


def test_of_many_meshes_that_are_missing_the_first_are_named(model: Path):
    shapes = [shape("collision", f'<mesh filename="{k}.stl"/>') for k in range(9)]
    _, problems, _ = resolve(model, *shapes)
    assert [f"mesh '{k}.stl'" in text for k, text in enumerate(problems[:3])] == [True] * 3
    assert problems[3:] == [f"{model}: 6 further meshes are not found"]


def test_pointers_of_git_lfs_are_reported_in_one_line(model: Path):
    for name in ("one.stl", "two.dae"):
        (model.parent / name).write_text("version https://git-lfs.github.com/spec/v1\noid x\n")
    shapes = [shape("collision", f'<mesh filename="{name}"/>') for name in ("one.stl", "two.dae")]
    _, problems, _ = resolve(model, *shapes)
    assert problems == [
        f"{model}: mesh 'one.stl' is a Git LFS pointer, expected the file itself: "
        "run `git lfs pull`"
    ]


def test_a_mesh_that_is_used_twice_is_converted_once(model: Path):
    link, problems, _ = resolve(model, shape("collision", PART), shape("collision", PART))
    assert not problems
    assert {mesh.get("filename") for mesh in link.iter("mesh")} == {"hull_0.stl"}


def test_a_mesh_that_is_too_large_is_refused_by_its_size(model: Path):
    with (model.parent / "huge.obj").open("wb") as file:
        file.truncate(MAX_ASSET + 1)
    _, problems, _ = resolve(model, shape("collision", '<mesh filename="huge.obj"/>'))
    assert f"cannot be read (it has more than {MAX_ASSET} bytes" in problems[0]


def test_meshes_that_are_too_large_together_are_refused(model: Path, monkeypatch):
    monkeypatch.setattr(urdf_shapes, "MAX_ASSETS", 100)
    _, problems, _ = resolve(model, shape("collision", PART))
    assert "with it all meshes have" in problems[0]
