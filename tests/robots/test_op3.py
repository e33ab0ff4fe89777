"""The OP3's own description: its facts, its symmetry, its stance, its shapes."""

import json

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mirror_images import mirror_posture
from nonempty import nonempty
from paths import REPOSITORY, SHARED

from humanoid_getup.simulation.world import World
from robots import Posture, Robot, load_robot, quaternion
from robots.body.overlap import overlaps_at
from robots.kinematics import place

FACTS_FILE = SHARED / "robots" / "op3.json"
OP3 = load_robot("op3")
MODEL = OP3.spec().compile()
SIDES = {"l": "r", "r": "l"}


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


@st.composite
def postures(draw):
    numbers = st.floats(-1.0, 1.0)
    share = np.array(draw(st.lists(st.floats(0.0, 1.0), min_size=OP3.n, max_size=OP3.n)))
    q = np.array(draw(st.lists(numbers, min_size=4, max_size=4)))
    q[0] += 0.01
    q = q if np.linalg.norm(q) > 0.1 else quaternion.IDENTITY
    return Posture(
        position=np.array(draw(st.lists(numbers, min_size=3, max_size=3))),
        orientation=quaternion.normalize(q),
        joint_pos=OP3.lower + share * (OP3.upper - OP3.lower),
    )


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


@given(posture=postures())
def test_a_mirrored_posture_is_the_mirror_image_in_space(posture):
    here, there = configured(posture), configured(mirror_posture(OP3, posture))
    checked = 0
    for site in range(MODEL.nsite):
        name = MODEL.site(site).name
        side, _, rest = name.partition("_")
        image = f"{SIDES[side]}_{rest}" if side in SIDES else name
        expected = here.site(name).xpos * [1.0, -1.0, 1.0]
        assert there.site(image).xpos == pytest.approx(expected, abs=1e-9), name
        checked += 1
    assert checked >= 6  # neck, imu, two soles, two hands


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


def test_no_link_overlaps_another_at_zero_and_in_the_stance():
    for joint_pos in (np.zeros(OP3.n), OP3.standing.joint_pos):
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]), orientation=quaternion.IDENTITY, joint_pos=joint_pos
        )
        assert configured(posture).ncon == 0


MESHES = SHARED / "models" / "op3-mesh"
pytestmark = pytest.mark.skipif(not MESHES.exists(), reason="needs the mesh model in ../shared")
SAMPLES = 1500


@pytest.fixture(scope="module")
def mesh_world(op3: Robot) -> World:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(REPOSITORY / "benchmarks"))
        from mesh_robot import with_meshes  # pyright: ignore[reportMissingImports]
    return World(with_meshes(op3, MESHES))


def test_shapes_overlap_where_the_meshes_do(world: World, mesh_world: World, op3: Robot):
    rng = np.random.default_rng(0)
    depth = []
    scratch = mujoco.MjData(world.model), mujoco.MjData(mesh_world.model)
    for _ in range(SAMPLES):
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]),
            orientation=np.array([1.0, 0.0, 0.0, 0.0]),
            joint_pos=rng.uniform(op3.lower, op3.upper),
        )
        both = zip((world, mesh_world), scratch, strict=True)
        depth.append(
            [overlaps_at(w.model, place(w.robot, w.model, posture), data).max() for w, data in both]
        )
    own, mesh = np.array(depth).T
    clear, deep = 0.001, 0.006  # m
    assert np.sum(mesh > deep) > SAMPLES / 4
    assert np.sum((own > deep) & (mesh < clear)) <= 0.007 * SAMPLES  # 1.5 % with bounding boxes
    assert np.sum((mesh > deep) & (own < clear)) <= 0.003 * SAMPLES
