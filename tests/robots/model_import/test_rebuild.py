"""The robot's own model: what it was built from moves, weighs and resists in the same way."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from small_humanoid import small_humanoid

from robots import quaternion
from robots.model_import.anatomy import find_anatomy
from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.rebuild import Rebuilder
from robots.model_import.source import ModelSource
from robots.model_import.tree import find_tree
from robots.quaternion import Array

Built = tuple[mujoco.MjModel, mujoco.MjModel, list[str]]
FRAME = quaternion.normalize(np.array([0.6, 0.3, -0.5, 0.2]))


def rebuild(
    *,
    fixed: tuple[str, ...] = (),
    change: Callable[[mujoco.MjSpec], object] = lambda _: None,
    stance: dict[str, float] | None = None,
    **where,
) -> Built:
    """Return a small humanoid, what is built from it, and the notes."""
    old = mujoco.MjModel.from_xml_string(small_humanoid(change=change, **where))
    source = ModelSource(path=Path("m.xml"), model=old, actuators={}, stance=stance or {})
    notes: list[str] = []
    anatomy = find_anatomy(find_tree(source, []), Path("m.xml"), [])
    builder = Rebuilder(anatomy, keep_hulls=False, fixed=fixed, notes=notes)
    return old, builder.build("small").compile(), notes


def pose(model: mujoco.MjModel, angles: dict[str, float]) -> mujoco.MjData:
    """Look at a model whose torso stands upright at the origin."""
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
            data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    return data


def draw_angles(model: mujoco.MjModel, seed: int = 0) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {model.joint(j).name: rng.uniform(-1.0, 1.0) for j in range(1, model.njnt)}


def weigh(model: mujoco.MjModel, angles: dict[str, float]) -> Array:
    """Return the mass matrix of the joints, (n, n), without the root."""
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, pose(model, angles), matrix)
    return matrix[6:, 6:]


def seen_from_torso(data: mujoco.MjData, points: Array) -> Array:
    """Return points of the world from the torso's origin."""
    return points - data.body("torso").xpos


@pytest.mark.parametrize("where", [{}, {"frame": FRAME}, {"position": (0.3, -0.2, 0.5)}])
def test_all_bodies_move_and_weigh_as_before(where: dict):
    """A torso's frame that was turned in its model points forward and up; nothing else differs.

    The energy of moving joints is the same: the mass matrix without the root's own axes.
    """
    old, new, _ = rebuild(**where)
    angles = draw_angles(old)
    was, now = pose(old, angles), pose(new, angles)
    for body in range(2, old.nbody):
        name = old.body(body).name
        assert seen_from_torso(now, now.body(name).xpos) == pytest.approx(
            seen_from_torso(was, was.body(name).xpos)
        )
    total = now.subtree_com[1] - now.body("torso").xpos
    assert total == pytest.approx(was.subtree_com[1] - was.body("torso").xpos)
    assert weigh(new, angles) == pytest.approx(weigh(old, angles), abs=1e-7)
    assert new.body_mass.sum() == pytest.approx(old.body_mass.sum())


def test_a_hinge_that_is_fixed_is_welded_at_its_angle():
    """What hangs on it is where it was in the pose in which the model was read."""
    fixed, angles = "left_upper_arm_joint", {"left_upper_arm_joint": 0.8}
    old, new, _ = rebuild(fixed=(fixed,), stance=angles)
    assert mujoco.mj_name2id(new, mujoco.mjtObj.mjOBJ_JOINT, fixed) < 0
    assert mujoco.mj_name2id(new, mujoco.mjtObj.mjOBJ_BODY, "left_upper_arm") < 0
    moved = draw_angles(old) | angles
    was, now = pose(old, moved), pose(new, moved)
    assert seen_from_torso(now, now.body("left_forearm").xpos) == pytest.approx(
        seen_from_torso(was, was.body("left_forearm").xpos)
    )
    kept = [k for k in range(old.nv - 6) if old.joint(k + 1).name != fixed]
    whole = weigh(old, moved)[np.ix_(kept, kept)]
    assert weigh(new, moved) == pytest.approx(whole, abs=1e-7)
    assert new.body_mass.sum() == pytest.approx(old.body_mass.sum())


def test_a_picture_does_not_collide_where_a_welded_part_does():
    """The foot of some models is a picture, with the shape that stands welded to it."""

    def split(spec: mujoco.MjSpec) -> None:
        foot = spec.body("left_foot")
        (picture,) = foot.geoms
        picture.contype = picture.conaffinity = 0
        plate = foot.add_body(name="plate")
        plate.add_geom(type=picture.type, size=[0.05, 0.03, 0.005], pos=picture.pos, mass=0.0)

    _, new, _ = rebuild(change=split)
    foot = new.body("left_foot")
    assert foot.geomnum[0] == 1
    assert new.geom_size[foot.geomadr[0]] == pytest.approx([0.05, 0.03, 0.005])


def test_contacts_that_were_switched_off_stay_so():
    def exclude(spec: mujoco.MjSpec) -> None:
        spec.add_exclude(bodyname1="torso", bodyname2="left_upper_arm")
        spec.add_exclude(bodyname1="left_shank", bodyname2="right_shank")

    _, new, _ = rebuild(change=exclude)
    pairs = {
        frozenset((new.body(int(s) >> 16).name, new.body(int(s) & 0xFFFF).name))
        for s in new.exclude_signature
    }
    assert pairs == {
        frozenset(("torso", "left_upper_arm")),
        frozenset(("left_shank", "right_shank")),
    }


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
