"""Meshes that MuJoCo does not read become the convex hull of their points."""

from pathlib import Path

import numpy as np
import pytest
from text_meshes import CORNERS, write_text_stl

from robots.model_import import mesh_files
from robots.model_import.mesh_files import is_readable, read_hull

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
        (collada("<matrix>1 2 3</matrix>"), "<matrix> has 3 numbers"),
        (collada("<scale>1 x 3</scale>"), "could not be read|a text where numbers"),
        (collada("<node>" * 300 + "</node>" * 300), "nested too deep"),
        (collada(numbers="0 0 0 1 0 0 2 0 0 3 0 0"), "in one line or place"),
        (collada(numbers="1 1 1 1 1 1 1 1 1 1 1 1"), "in one line or place"),
        (collada(numbers="0 0 0 1 0 0 0 1e300 0 0 0 1"), "holds no solid"),
        (collada(numbers="0 0 0 1 0 0 0 nan 0 0 0 1"), "holds no solid"),
        (collada(numbers="0 0 0 1 0"), "cannot reshape"),
        (collada().replace('"0.01"', '"much"'), "could not convert"),
        ("<?xml version='1.0' encoding='nonsense'?><COLLADA/>", "not XML"),
        ("<?xml version='1.0' encoding='utf-7'?><COLLADA/>", "multi-byte|not XML"),
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
    monkeypatch.setattr(mesh_files, "MOST_POINTS", 4)
    assert len(read_corners(file)) == 4
    monkeypatch.setattr(mesh_files, "MOST_POINTS", 3)
    with pytest.raises(ValueError, match="it has 4 corners, expected at most 3"):
        read_hull(file)
