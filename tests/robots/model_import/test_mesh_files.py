"""Meshes that MuJoCo does not read become the convex hull of their points."""

from pathlib import Path

import numpy as np
import pytest

from robots.model_import.mesh_files import is_readable, read_hull

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
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


def write_text_stl(path: Path) -> Path:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS[list(face)])
        + "endloop\nendfacet\n"
        for face in FACES
    )
    path.write_text(f"solid tetrahedron\n{facets}endsolid\n")
    return path


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


@pytest.mark.parametrize("content", [b"", b"solid nothing\nendsolid", b"<COLLADA/>"])
@pytest.mark.parametrize("suffix", [".stl", ".dae"])
def test_what_holds_no_solid_is_refused(tmp_path: Path, content: bytes, suffix: str):
    path = tmp_path / f"part{suffix}"
    path.write_bytes(content)
    assert not is_readable(path)
    with pytest.raises(ValueError, match=r"no solid|not XML"):
        read_hull(path)
