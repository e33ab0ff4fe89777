"""The OP3's own description: its facts, its symmetry, its stance, its shapes."""

import json

import mujoco
import numpy as np
import pytest
from benchmark_scripts import load_script
from nonempty import nonempty
from paths import SHARED

from humanoid_getup.simulation.world import World
from robots import Posture, Robot, load_robot, quaternion
from robots.body.overlap import overlaps_at
from robots.kinematics import place

FACTS_FILE = SHARED / "robots" / "op3.json"
MESHES = SHARED / "models" / "op3-mesh"
OP3 = load_robot("op3")
MODEL = OP3.spec().compile()


@pytest.fixture(scope="module")
def facts():
    if not FACTS_FILE.is_file():
        pytest.skip("the robot facts (shared/robots/op3.json) are not beside this checkout")
    return json.loads(FACTS_FILE.read_text("utf-8"))


def configured(posture: Posture) -> mujoco.MjData:
    """The model's kinematics in a posture."""
    data, layout = mujoco.MjData(MODEL), OP3.layout(MODEL)
    data.qpos[layout.root_qpos :][:3] = posture.position
    data.qpos[layout.root_qpos + 3 :][:4] = posture.orientation
    data.qpos[layout.qpos] = posture.joint_pos
    mujoco.mj_forward(MODEL, data)
    return data


def test_bodies_have_the_facts_masses_and_inertias(facts):
    assert len(facts["bodies"]) == MODEL.nbody - 1
    for body in facts["bodies"]:
        view = MODEL.body(body["name"])
        assert view.mass[0] == pytest.approx(body["mass"]), body["name"]
        assert view.ipos == pytest.approx(body["com"], abs=1e-9), body["name"]
        principal = sorted(view.inertia, reverse=True)
        assert principal == pytest.approx(body["inertia_principal_sorted"], rel=1e-3)
        if body["parent"] != "world":
            assert MODEL.body(view.parentid[0]).name == body["parent"]
            assert view.pos == pytest.approx(body["pos"], abs=1e-9), body["name"]
    assert mujoco.mj_getTotalmass(MODEL) == pytest.approx(facts["totals"]["mass_model"], abs=1e-5)


def test_joints_servos_and_stance_are_the_facts(facts):
    assert {joint["name"] for joint in facts["joints"]} == set(OP3.joint_names)
    for fact in facts["joints"]:
        joint = OP3.joints[OP3.joint_names.index(fact["name"])]
        found = (joint.servo.id, joint.servo.sign, joint.servo.zero_ticks)
        assert found == (fact["servo_id"], fact["sign"], fact["zero_tick"])
        assert fact["servo"].startswith(joint.servo.model.name)
        assert MODEL.joint(joint.name).axis == pytest.approx(fact["axis"])
        assert MODEL.body(MODEL.joint(joint.name).bodyid[0]).name == fact["body"]
        lowest, highest = fact["range_urdf_rad"]
        assert lowest - 1e-6 <= joint.lower < 0.0 < joint.upper <= highest + 1e-6
    walk_ready = facts["poses_rad"]["walk_ready"]
    for name, angle in nonempty(zip(OP3.joint_names, OP3.standing.joint_pos, strict=True)):
        assert angle == pytest.approx(walk_ready.get(name, 0.0), abs=1e-3), name


def test_standing_has_level_soles_on_the_ground_and_its_mass_over_them():
    data = configured(OP3.standing)
    assert len(OP3.sole_sites) == 2
    for sole in OP3.sole_sites:
        assert data.site(sole).xpos[2] == pytest.approx(0.0, abs=1e-4)
        assert data.site(sole).xmat.reshape(3, 3)[2, 2] == pytest.approx(1.0, abs=1e-6)
    assert data.site(OP3.neck_site).xpos[2] == pytest.approx(OP3.standing_neck_height, abs=1e-4)
    com = data.subtree_com[OP3.layout(MODEL).torso]
    ahead = com[0] - np.mean([data.site(sole).xpos[0] for sole in OP3.sole_sites])
    assert abs(ahead) < 0.061  # half a sole's length
    assert abs(com[1]) < 1e-3


MESHES = SHARED / "models" / "op3-mesh"
pytestmark = pytest.mark.skipif(not MESHES.exists(), reason="needs the mesh model in ../shared")


@pytest.mark.skipif(not MESHES.exists(), reason="needs the mesh model in ../shared")
def test_shapes_overlap_where_the_convex_meshes_of_the_links_do(world: World, op3: Robot):
    worlds = world, World(load_script("mesh_robot").with_meshes(op3, MESHES))
    scratch = [mujoco.MjData(each.model) for each in worlds]
    samples, rng = 1000, np.random.default_rng(0)
    depth = []
    for joint_pos in rng.uniform(op3.lower, op3.upper, (samples, op3.n)):
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]), orientation=quaternion.IDENTITY, joint_pos=joint_pos
        )
        both = zip(worlds, scratch, strict=True)
        rows = [overlaps_at(w.model, place(w.robot, w.model, posture), data) for w, data in both]
        depth.append([row.max() for row in rows])
    own, mesh = np.array(depth).T
    clear, deep = 0.001, 0.006  # m
    assert np.sum(mesh > deep) > samples / 4
    assert np.sum((own > deep) & (mesh < clear)) <= 0.007 * samples  # 1.5 % with bounding boxes
    assert np.sum((mesh > deep) & (own < clear)) <= 0.003 * samples
