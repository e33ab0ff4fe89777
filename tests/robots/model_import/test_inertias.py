"""Inertias that a link cannot have: found by its shapes, and replaced by those of a box."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from small_humanoid import small_humanoid

from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.inertias import find_excess

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * [0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    ("radius", "height", "is_impossible"),
    [(0.37, 1.0, False), (0.74, 1.0, False), (0.76, 1.0, True), (0.76, 2.0, False)],
)
def test_an_inertia_cannot_be_that_of_mass_beyond_the_shapes(radius, height, is_impossible):
    """By hand: they reach 0.374 m. A link of a tall robot may have a placeholder for one."""
    inertia = 2.0 * radius**2 * np.eye(3)
    excess = find_excess(inertia, 2.0, CORNERS, height)
    largest = 2.0 / 12.0 * (0.4**2 + 0.6**2)
    assert excess == pytest.approx(2.0 * radius**2 / largest if is_impossible else 0.0)
    assert find_excess(inertia, 2.0, np.zeros((0, 3)), height) == 0.0


def test_inertias_in_other_units_are_replaced_and_said_in_one_line(tmp_path: Path):
    """Those of HROS5 are in g·m², and 1000 times too large."""

    def enlarge(spec: mujoco.MjSpec) -> None:
        model = spec.compile()
        for body in spec.bodies[1:]:
            body.explicitinertial, body.mass = True, model.body(body.name).mass[0]
            body.ipos, body.iquat = model.body(body.name).ipos, model.body(body.name).iquat
            body.inertia = 1000.0 * model.body(body.name).inertia

    (tmp_path / "model.xml").write_text(small_humanoid(change=enlarge))
    robot = import_model(tmp_path / "model.xml", ImportOptions(name="small"))
    (note,) = robot.notes
    assert note.startswith("inertias up to 1000 times those of boxes of their size are replaced by")
    found, true = robot.spec.compile(), mujoco.MjModel.from_xml_string(small_humanoid())
    for name in ("torso", "left_thigh", "right_foot"):
        assert name in note
        assert sorted(found.body(name).inertia) == pytest.approx(sorted(true.body(name).inertia))
