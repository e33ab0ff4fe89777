"""Links: a body with joints, with all that is welded to it."""

import mujoco
import pytest

from robots.body.links import Link, gather_links

MODEL = """<mujoco><worldbody><body name="torso"><freejoint/><geom size="0.1"/>
  <body name="pack"><geom name="pack" size="0.1"/><site name="badge"/>
    <body name="flap"><joint name="flap" pos="0 0 0.02" axis="1 0 0"/><geom size="0.1"/></body>
  </body>
  <body name="arm"><joint name="lift"/><joint name="turn"/><geom size="0.1"/>
    <body name="hand"><geom size="0.1"/></body></body>
</body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def torso() -> Link:
    model = mujoco.MjModel.from_xml_string(MODEL)
    return gather_links(model, model.body("torso").id)


def names(torso: Link, bodies: list[int]) -> list[str]:
    return [torso.model.body(body).name for body in bodies]


def test_welded_bodies_are_one_link(torso: Link):
    assert names(torso, torso.bodies) == ["torso", "pack"]
    assert names(torso, [link.root for link in torso.children]) == ["arm", "flap"]
    assert names(torso, torso.children[0].bodies) == ["arm", "hand"]


def test_a_link_knows_its_joints_sites_and_shapes(torso: Link):
    model, arm = torso.model, torso.children[0]
    assert [model.joint(joint).name for joint in arm.joints] == ["lift", "turn"]
    assert [model.site(site).name for site in torso.sites] == ["badge"]
    assert model.geom(torso.geoms[1]).name == "pack"
    assert len(torso.geoms) == len(arm.geoms) == 2


def test_a_link_is_anchored_at_its_joint_and_a_torso_at_its_origin(torso: Link):
    assert torso.anchor().tolist() == [0.0, 0.0, 0.0]
    assert torso.children[1].anchor().tolist() == [0.0, 0.0, 0.02]
