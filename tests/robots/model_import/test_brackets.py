"""Brackets: shapes that overlap by construction lose their contacts, others keep them."""

import mujoco
import numpy as np

from robots.body.joint_view import JointView
from robots.model_import.brackets import (
    exclude_brackets,
    find_brackets,
    find_own_overlaps,
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


def test_links_that_always_overlap_are_brackets():
    _, model = build(-0.04)  # its end is 3 cm deep in the torso, two hinges away
    pairs = find_brackets(view(model), np.zeros(3), np.random.default_rng(0))
    assert [tuple(model.body(b).name for b in pair) for pair in pairs] == [("torso", "link")]


def test_their_contacts_are_switched_off():
    spec, model = build(-0.04)
    assert exclude_brackets(spec, view(model), np.zeros(3)) == "torso with link"
    changed = spec.compile()
    data = mujoco.MjData(changed)
    mujoco.mj_forward(changed, data)
    assert data.ncon == 0


ARM = """<mujoco><worldbody><body name="torso"><freejoint/>
  <geom type="box" size="0.05 0.1 0.2" mass="1"/>
  <body name="shoulder" pos="0 0.13 0.15"><joint axis="0 1 0" range="-60 60"/>
    <geom size="0.01" mass="0.1"/>
    <body name="upper_arm" pos="0 0.01 0"><joint axis="1 0 0" range="-60 60"/>
      <geom type="capsule" fromto="0 0 -0.03 0 0 -0.12" size="0.02" mass="0.1"/>
      <body name="forearm" pos="0 0 -0.15"><joint axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 -0.03 0 IN -0.15" size="0.02" mass="0.1"/></body></body>
  </body></body></worldbody></mujoco>"""


def test_a_forearm_that_touches_the_torso_is_none():
    """Three hinges are between them, as between pelvis and thigh, but far from each other."""
    model = mujoco.MjModel.from_xml_string(ARM.replace("IN", "-0.05"))
    touching = find_own_overlaps(view(model), np.zeros(3))
    assert [tuple(model.body(b).name for b in pair) for pair in touching] == [("torso", "forearm")]
    assert find_brackets(view(model), np.zeros(3), np.random.default_rng(0)) == []
