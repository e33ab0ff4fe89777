"""Stretching links along which they are long: masses and inertias as MuJoCo's own."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_robots import LEGS, build_skeleton, limb, make_robot

from robots import BodyError, Robot
from robots.individual import make_explicit
from robots.quaternion import Array
from robots.reshaping.reshape_model import find_directions
from robots.reshaping.stretching import (
    AxialStretch,
    Inertia,
    Skeleton,
    stretch_geom,
    stretch_link,
)

UP = np.array([0.0, 0.0, 1.0])


def box(mass: float, center, half) -> Inertia:
    """A uniform box with its edges along the axes."""
    return Inertia(mass, np.array(center), np.diag(mass * np.array(half) ** 2 / 3.0))


def turned(seed: int) -> np.ndarray:
    """A random rotation matrix."""
    matrix = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix))


@given(seed=st.integers(0, 10_000), factor=st.floats(0.25, 4.0))
def test_the_second_moment_of_any_body_becomes_f_a_s_a(seed: int, factor: float):
    rng, axes = np.random.default_rng(seed), turned(seed)
    half, center, origin = rng.uniform(0.01, 0.1, 3), rng.normal(size=3), rng.normal(size=3)
    u = axes @ np.array([0.6, 0.0, 0.8])
    spread = axes @ np.diag(half**2) @ axes.T
    found = Inertia(1.5, center, spread).stretched(AxialStretch(origin, u, factor))
    A = np.eye(3) + (factor - 1.0) * np.outer(u, u)
    assert found.mass == pytest.approx(1.5 * factor)
    assert found.center == pytest.approx(origin + A @ (center - origin))
    assert found.spread == pytest.approx(factor * A @ spread @ A.T, abs=1e-9)


def test_a_box_that_is_stretched_above_its_middle_alone_is_two_boxes():
    stretch = AxialStretch(np.array([0.0, 0.0, 0.05]), UP, 2.0, beyond=True)
    found = box(1.0, [0.0, 0.0, 0.05], [0.02, 0.05, 0.05]).stretched(stretch)
    # Below: 0.5 kg from z = 0 to 0.05; above: 1 kg from 0.05 to 0.15. Mean 0.025 and 0.10.
    center = (0.5 * 0.025 + 1.0 * 0.10) / 1.5
    spread = 0.5 * (0.05**2 / 12 + (0.025 - center) ** 2)
    spread += 1.0 * (0.10**2 / 12 + (0.10 - center) ** 2)
    assert found.mass == pytest.approx(1.5)
    assert found.center == pytest.approx([0.0, 0.0, center], rel=1e-3)
    assert found.spread[2, 2] == pytest.approx(spread, rel=1e-3)


ARM = limb("arm", "0 0.1 0.15", inside=limb("elbow", "0 0 -0.1") + '<site name="tip" pos="0 0 0"/>')
ONE = """<mujoco><worldbody><body name="b"><freejoint/>
  <geom name="g" type="{kind}" size="{size}" density="800"/></body></worldbody></mujoco>"""


def stretch_arm(folder: Path, factor: float, *, keep: bool = False) -> mujoco.MjModel:
    """Stretch the arm's first link along z, and keep its child where it is, if asked for."""
    skeleton = build_skeleton(make_robot(folder, LEGS + ARM))
    ((_, arm),) = skeleton.parts.arms
    kept = [child.root for child in arm.children] if keep else []
    stretch_link(skeleton, arm, AxialStretch(arm.anchor(), UP, factor), kept)
    return skeleton.spec.compile()


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_a_link_is_as_long_and_as_heavy_as_asked(tmp_path: Path, factor: float):
    model = stretch_arm(tmp_path, factor)
    body = model.body("arm_link")
    assert body.pos == pytest.approx([0.0, 0.1, 0.15])  # its frame stays
    assert model.body("elbow_link").pos == pytest.approx([0.0, 0.0, -0.1 * factor])
    (geom,) = np.flatnonzero(model.geom_bodyid == body.id)
    assert model.geom_size[geom] == pytest.approx([0.03, 0.02, 0.05 * factor])
    assert model.geom_pos[geom] == pytest.approx([0.0, 0.0, -0.05 * factor])
    assert body.mass == pytest.approx(0.1 * factor)
    assert body.ipos == pytest.approx([0.0, 0.0, -0.05 * factor])
    # By hand: a box of that size, m/3 times the squares of its half edges.
    squares = np.array([0.03, 0.02, 0.05 * factor]) ** 2
    moments = 0.1 * factor / 3.0 * (squares.sum() - squares)
    assert np.sort(body.inertia) == pytest.approx(np.sort(moments))


def build_one(kind: str, size: str) -> Skeleton:
    """Build the skeleton of a single shape of a density, its mass written out."""
    spec = mujoco.MjSpec.from_string(ONE.format(kind=kind, size=size))
    make_explicit(spec)
    return Skeleton(spec, torso="b", sole_sites=(), head_joints=())


@pytest.mark.parametrize(
    ("kind", "size", "longer"),
    [
        ("box", "0.02 0.03 0.05", "0.02 0.03 0.1"),
        ("ellipsoid", "0.02 0.03 0.05", "0.02 0.03 0.1"),
        ("cylinder", "0.02 0.05", "0.02 0.1"),
    ],
)
def test_a_stretched_shape_is_the_longer_shape(kind: str, size: str, longer: str):
    """MuJoCo computes the longer one's mass and inertia itself."""
    skeleton = build_one(kind, size)
    stretch_link(skeleton, skeleton.torso, AxialStretch(np.zeros(3), UP, 2.0))
    found = skeleton.spec.compile()
    wanted = mujoco.MjModel.from_xml_string(ONE.format(kind=kind, size=longer))
    assert found.geom_size == pytest.approx(wanted.geom_size)
    assert found.body("b").mass == pytest.approx(wanted.body("b").mass)
    assert np.sort(found.body("b").inertia) == pytest.approx(np.sort(wanted.body("b").inertia))


def test_the_caps_of_a_capsule_stay_round():
    """By hand: 14 cm from end to end become 28 cm, of which the caps take 4 cm."""
    for factor, half in ((2.0, 0.12), (0.1, 1e-4)):
        skeleton = build_one("capsule", "0.02 0.05")
        geom = skeleton.spec.geom("g")
        stretch_geom(skeleton, geom, AxialStretch(np.zeros(3), UP, factor))
        assert geom.size[:2] == pytest.approx([0.02, half])


def test_a_model_of_a_given_mass_may_become_heavier():
    spec = mujoco.MjSpec.from_string(ONE.format(kind="box", size="0.1 0.1 0.1"))
    spec.compiler.settotalmass = 3.0
    with pytest.warns(UserWarning, match="settotalmass"):
        make_explicit(spec)
    assert spec.body("b").mass == pytest.approx(3.0)
    spec.body("b").mass = 6.0
    assert spec.compile().body("b").mass == pytest.approx(6.0)


DOWN, AHEAD = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])


def directions_of(robot: Robot, arm: bool = True) -> dict[str, Array]:
    skeleton = build_skeleton(robot)
    limbs = skeleton.parts.arms if arm else skeleton.parts.legs
    found = find_directions(skeleton, limbs[0][1])
    return {skeleton.root(link).name: direction for link, direction in found.items()}


def test_a_bracket_follows_the_long_link_below_it(tmp_path: Path):
    """Between two joints 5 mm apart, sideways, there is no direction of its own."""
    bracket = '<body name="bracket" pos="0 0 0.15"><joint name="turn" axis="0 0 1" range="-9 9"/>'
    bracket += f'<geom size="0.01" mass="0.01"/>{limb("arm", "0 0.005 0")}</body>'
    found = directions_of(make_robot(tmp_path, LEGS + bracket))
    assert found["bracket"] == pytest.approx(DOWN)


def test_a_direction_is_that_of_the_nearest_axis_of_its_shape(tmp_path: Path):
    """A forearm whose mass is a little in front of its axis is still long along its box."""
    ahead = limb("elbow", "0 0 -0.1", inside='<geom size="0.01" pos="0.02 0 -0.05" mass="0.05"/>')
    found = directions_of(make_robot(tmp_path, LEGS + limb("arm", "0 0 0.15", inside=ahead)))
    assert found["elbow_link"] == pytest.approx(DOWN)


def test_a_limb_of_no_length_is_refused(tmp_path: Path):
    ball = '<body name="ball" pos="0 0 0.2"><joint name="spin" axis="0 0 1" range="-9 9"/>'
    ball += '<geom size="0.01" mass="0.01"/></body>'
    with pytest.raises(BodyError, match="the limb 'ball' has no length"):
        directions_of(make_robot(tmp_path, LEGS + ball))
