"""Stances: balanced on flat soles at the height that is asked for, the arms hanging."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from robots.body.joint_view import JointView
from robots.model_import.body_plan import BodyPlan
from robots.model_import.stance import (
    StanceSolver,
    exclude_brackets,
    find_stance,
)

CHAIN = """<mujoco><worldbody><body name="torso"><freejoint/><geom size="0.05" mass="1"/>
  <body name="bracket" pos="0 0 0.1"><joint name="a" axis="0 1 0" range="-60 60"/>
    <geom size="0.01" mass="0.1"/>
    <body name="link"><joint name="b" axis="1 0 0" range="-60 60"/>
      <geom type="capsule" fromto="0 0 DEPTH 0 0 0.3" size="0.02" mass="0.1"/>
      <body name="hand" pos="0 0 0.33"><joint name="c" axis="0 1 0" range="-60 60"/>
        <geom size="0.008" mass="0.1"/></body></body></body>
</body></worldbody></mujoco>"""


def build(depth: float) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """Build a chain whose long link begins so much above its joint [m]."""
    spec = mujoco.MjSpec.from_string(CHAIN.replace("DEPTH", str(depth)))
    return spec, spec.compile()


def view(model: mujoco.MjModel) -> JointView:
    """View all hinges of a model."""
    return JointView(model, range(1, model.njnt))


def test_contacts_of_links_that_always_overlap_are_switched_off():
    spec, model = build(-0.04)  # its end is 3 cm deep in the torso, two hinges away
    assert exclude_brackets(spec, view(model), np.zeros(3)) == "torso with link"
    changed = spec.compile()
    data = mujoco.MjData(changed)
    mujoco.mj_forward(changed, data)
    assert data.ncon == 0


def test_arms_hang_beside_the_body_and_further_out_if_asked(small: BodyPlan):
    """The rest of a stance is a law of whole imports, in test_symmetries."""
    solver, arm = StanceSolver(small, np.zeros(len(small.joint_names))), small.arms[0][0]
    stance = solver.solve(0.9)
    assert np.all((stance.joint_pos >= small.lower) & (stance.joint_pos <= small.upper))

    def slope(angles: np.ndarray) -> float:
        small.view.look(angles)
        way = small.view.end(arm[-1]) - small.view.anchor(arm[0])
        return float(way[1] / -way[2])

    assert not solver.solve(1.2).is_solved, "a leg cannot be longer than stretched"
    near, far = slope(stance.joint_pos), slope(solver.solve(0.9, 0.6).joint_pos)
    assert near == pytest.approx(0.1, abs=0.1)
    assert far == pytest.approx(0.6, abs=0.1)


def search(small: BodyPlan) -> tuple[np.ndarray, list[str]]:
    notes: list[str] = []
    return find_stance(small, np.zeros(len(small.joint_names)), notes).joint_pos, notes


def limit(small: BodyPlan, joint: str, degrees: float) -> BodyPlan:
    """Leave the joints of a pair a narrow range about 0."""
    model = copy.copy(small.model)
    for side in ("left", "right"):
        model.jnt_range[model.joint(f"{side}_{joint}_joint").id] = np.radians([-degrees, degrees])
    return replace(small, model=model)


def test_stiff_ankles_leave_a_note_on_what_to_do(small: BodyPlan):
    stiff = limit(limit(small, "ankle", 0.5), "thigh", 0.5)
    _, notes = search(limit(stiff, "shank", 0.5))
    (note,) = notes
    assert note.startswith("no balanced stance on flat soles was found (off by ")
    assert note.endswith("write [standing] by hand, then getup robots check")
