"""Kinematics of a robot against MuJoCo's own, and laws of mirroring and of frames."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import (
    GravitySense,
    imu_in_torso,
    lowest_point,
    lowest_points,
    mirror_positions,
    place,
    read_posture,
    site_positions,
    torso_orientation,
    transfer_positions,
)

SHAPES = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1"/>
  <body><freejoint/><geom type="{kind}" size="0.1 0.2 0.05" pos="0.03 0 0.02" euler="20 30 0"/>
  </body></worldbody></mujoco>"""
SEEDS = st.integers(0, 10_000)


def draw_posture(robot: Robot, rng: np.random.Generator) -> Posture:
    return Posture(
        position=rng.uniform(-1.0, 1.0, 3),
        orientation=quaternion.normalize(rng.normal(size=4)),
        joint_pos=rng.uniform(robot.lower, robot.upper),
    )


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "ellipsoid", "box"])
def test_the_lowest_point_is_where_mujoco_would_touch_the_floor(kind: str):
    model = mujoco.MjModel.from_xml_string(SHAPES.format(kind=kind))
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(20):
        data.qpos[:] = [0.0, 0.0, 1.0, *quaternion.normalize(rng.normal(size=4))]
        mujoco.mj_kinematics(model, data)
        distance = mujoco.mj_geomDistance(model, data, 0, 1, 5.0, None)
        assert lowest_point(model, data.qpos) == pytest.approx(distance, abs=1e-6)


@given(seed=SEEDS)
def test_a_posture_comes_back_from_its_positions_and_their_mirror_images(
    op3: Robot, world: World, seed: int
):
    posture = draw_posture(op3, np.random.default_rng(seed))
    qpos = place(op3, world.model, posture)
    back = read_posture(op3, world.model, qpos)
    assert back.position == pytest.approx(posture.position)
    assert back.orientation == pytest.approx(posture.orientation)
    assert back.joint_pos == pytest.approx(posture.joint_pos)
    once = mirror_positions(op3, world.model, qpos)
    assert mirror_positions(op3, world.model, once) == pytest.approx(qpos)


@given(seed=SEEDS)
def test_a_mirrored_body_is_where_a_mirror_shows_it(tiny: Robot, seed: int):
    """Soles exchange their places, and all that is found of them is reflected in y = 0."""
    model, posture = tiny.spec().compile(), draw_posture(tiny, np.random.default_rng(seed))
    qpos = place(tiny, model, posture)
    mirrored = mirror_positions(tiny, model, qpos)
    left, right = tiny.sole_sites
    reflect = np.array([1.0, -1.0, 1.0])
    assert site_positions(model, mirrored[None], left) == pytest.approx(
        site_positions(model, qpos[None], right) * reflect
    )
    assert lowest_points(model, np.stack([qpos, mirrored])).std() == pytest.approx(0.0, abs=1e-9)


def test_positions_go_from_one_model_to_another_and_back(op3: Robot, world: World):
    bare, rng = op3.spec().compile(), np.random.default_rng(0)
    qpos = np.stack([place(op3, bare, draw_posture(op3, rng)) for _ in range(3)])
    there = transfer_positions(op3, bare, world.model, qpos)
    assert transfer_positions(op3, world.model, bare, there) == pytest.approx(qpos)
    sole = op3.sole_sites[0]
    assert site_positions(world.model, there, sole) == pytest.approx(
        site_positions(bare, qpos, sole)
    )


@given(seed=SEEDS)
def test_gravity_is_sensed_in_the_torso_however_the_imu_is_mounted(
    op3: Robot, world: World, seed: int
):
    rng = np.random.default_rng(seed)
    mounted, torso = (quaternion.normalize(rng.normal(size=4)) for _ in range(2))
    imu = quaternion.multiply(torso, mounted)
    expected = quaternion.rotate(quaternion.inverse(torso), np.array([0.0, 0.0, -1.0]))
    assert GravitySense(mounted)(imu) == pytest.approx(expected)
    assert GravitySense(mounted)(0.7 * imu) == pytest.approx(expected)  # of any length
    own = quaternion.multiply(torso, imu_in_torso(op3, world.model))
    assert quaternion.angle_between(
        torso_orientation(op3, world.model, own), torso
    ) == pytest.approx(0.0, abs=1e-6)


UNSTABLE = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


def test_a_simulation_that_diverges_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    model = mujoco.MjModel.from_xml_string(UNSTABLE)
    data = mujoco.MjData(model)
    data.qvel[0] = 1e300
    mujoco.mj_step(model, data)
    assert data.warning.number.sum() == 1
    assert list(tmp_path.iterdir()) == []
