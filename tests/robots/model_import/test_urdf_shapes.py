"""Meshes of a URDF are found beside it or above, and links fall back on the shapes they have."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from text_meshes import CORNERS, write_text_stl

from robots.model_import import urdf_shapes
from robots.model_import.urdf_shapes import UrdfShapes, find_mesh, is_readable, read_hull

COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<asset><unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array count="12">{numbers}</float_array></source>
<source id="n"><float_array count="3">9 9 9</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene>
<node><translate>10 0 0</translate><rotate>0 0 1 90</rotate>
<node><scale>2 2 2</scale><instance_geometry url="#g"/></node></node>
</visual_scene></library_visual_scenes></COLLADA>"""


def read_corners(path: Path) -> set[tuple[float, ...]]:
    file = path.with_suffix(".hull.stl")
    file.write_bytes(read_hull(path))
    assert is_readable(file)
    points = np.frombuffer(file.read_bytes()[84:], np.uint8).reshape(-1, 50)[:, 12:48]
    corners = points.copy().view("<f4").reshape(-1, 3).astype(float)
    return {tuple(corner.round(5).tolist()) for corner in corners}


def test_a_text_stl_keeps_its_corners(tmp_path: Path):
    path = write_text_stl(tmp_path / "part.STL")
    assert not is_readable(path)
    assert read_corners(path) == {tuple(c.tolist()) for c in CORNERS}


def test_a_collada_scene_is_placed_and_scaled(tmp_path: Path):
    (tmp_path / "part.dae").write_text(COLLADA.format(numbers=" ".join(map(str, CORNERS.ravel()))))
    # By hand: twice as large, turned so that x points to y and y to -x, moved by 10 units, in cm;
    # then y, which points up there, becomes z.
    moved = {(0.1 - 0.02 * y, -0.02 * z, 0.02 * x) for x, y, z in CORNERS}
    assert read_corners(tmp_path / "part.dae") == {tuple(np.round(m, 5).tolist()) for m in moved}


def collada(scene: str = "", numbers: str = "0 0 0 1 0 0 0 2 0 0 0 3") -> str:
    text = COLLADA.format(numbers=numbers)
    return text.replace("<translate>10 0 0</translate>", scene) if scene else text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (collada("<rotate>0 0 1</rotate>"), "<rotate> has 3 numbers"),
        (collada("<scale>1 x 3</scale>"), "could not be read|a text where numbers"),
        (collada("<node>" * 300 + "</node>" * 300), "nested too deep"),
        (collada(numbers="0 0 0 1 0 0 2 0 0 3 0 0"), "in one line or place"),
        (collada(numbers="0 0 0 1 0 0 0 1e300 0 0 0 1"), "holds no solid"),
        ("<COLLADA><a></COLLADA>", "not XML"),
    ],
)
def test_a_collada_file_that_cannot_be_used_is_refused(tmp_path: Path, content: str, message: str):
    (tmp_path / "part.dae").write_text(content)
    with pytest.raises(ValueError, match=message):
        read_hull(tmp_path / "part.dae")


def test_a_mesh_of_too_many_corners_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Corners that faces share count once."""
    file = write_text_stl(tmp_path / "part.stl")
    monkeypatch.setattr(urdf_shapes, "MOST_POINTS", 4)
    assert len(read_corners(file)) == 4
    monkeypatch.setattr(urdf_shapes, "MOST_POINTS", 3)
    with pytest.raises(ValueError, match="it has 4 corners, expected at most 3"):
        read_hull(file)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The place of a model in a package; its meshes lie beside its folder."""
    (tmp_path / "robot" / "urdf").mkdir(parents=True)
    (tmp_path / "robot" / "meshes").mkdir()
    write_text_stl(tmp_path / "robot" / "meshes" / "Part.STL")
    return tmp_path / "robot" / "urdf" / "model.urdf"


def test_a_mesh_is_found_by_any_of_its_names(model: Path):
    for name in (
        "../meshes/Part.STL",
        "meshes/part.stl",
        "package://robot/meshes/Part.STL",
        "package://elsewhere/meshes/part.stl",
        "file://../meshes/Part.STL",
    ):
        found = (model.parent.parent / "meshes" / "Part.STL").resolve()
        assert find_mesh(model, name) == found, name


def shape(kind: str, content: str) -> str:
    return f"<{kind}><geometry>{content}</geometry></{kind}>"


def resolve(model: Path, *shapes: str) -> tuple[ET.Element, list[str], list[str]]:
    """Return the link that remains, the problems, and the notes."""
    root = ET.fromstring(f'<robot><link name="a">{"".join(shapes)}</link></robot>')
    notes: list[str] = []
    problems = UrdfShapes(model, root, notes).resolve()
    return root[0], problems, notes


PART, NONE = '<mesh filename="meshes/Part.STL"/>', '<mesh filename="none.stl"/>'


def test_shapes_that_collide_are_preferred_and_those_for_the_eye_stand_in(model: Path):
    link, problems, notes = resolve(model, shape("visual", PART), shape("collision", "<box/>"))
    assert ([part.tag for part in link], problems, notes) == (["collision"], [], [])
    link, problems, notes = resolve(model, shape("visual", PART), shape("collision", NONE))
    assert ([part.tag for part in link], problems) == (["visual"], [])
    assert "its visual shapes are used, as mesh 'none.stl'" in notes[0]
    assert next(link.iter("mesh")).get("filename") == "hull_0.stl"
    _, (problem,), _ = resolve(model, shape("visual", NONE), shape("collision", NONE))
    assert "mesh 'none.stl' of link 'a' is not found" in problem


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
