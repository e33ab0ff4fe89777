"""A tetrahedron as a text STL file."""

from pathlib import Path

import numpy as np

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def write_text_stl(path: Path) -> Path:
    """Write it; return the path."""
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS[list(face)])
        + "endloop\nendfacet\n"
        for face in FACES
    )
    path.write_text(f"solid tetrahedron\n{facets}endsolid\n")
    return path
