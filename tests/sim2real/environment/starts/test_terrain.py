"""The terrain has every patch that a scene of its name has, and opens level by level."""

import math

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.scenes.named_scenes import ROUGHNESS
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.body.parts import leg_length
from robots.kinematics import place
from sim2real.environment.starts import make_terrain_pool, sample_terrain_stands
from sim2real.environment.terrain import LEVELS, SLOPES, Terrain, build_terrain
from sim2real.environment.training_world import build_training_world

PHYSICS_STEP = 0.006  # s
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def terrain(op3: Robot) -> Terrain:
    return build_terrain(op3, np.random.default_rng(0))


@pytest.fixture(scope="module")
def terrain_world(op3: Robot, terrain: Terrain) -> World:
    return build_training_world(op3, terrain.scene, PHYSICS_STEP)


def sample(terrain: Terrain, name: str) -> tuple[np.ndarray, ...]:
    """Sample places where robots fall on a patch, and the heights there [m]."""
    (patch,) = (patch for patch in terrain.patches if patch.name == name)
    x, y = np.meshgrid(np.linspace(*patch.region.x, 40), np.linspace(*patch.region.y, 40))
    return x, y, terrain.scene.ground.height(x, y)


def test_every_level_is_rough_as_its_scene_and_steep_as_its_slope(op3, terrain):
    leg = leg_length(op3)
    assert terrain.patches[0].name == "flat"
    assert np.ptp(sample(terrain, "flat")[2]) == 0.0
    for name, share in ROUGHNESS.items():
        heights = sample(terrain, f"rough:{name}")[2]
        assert 0.6 * share * leg < np.abs(heights).max() <= share * leg + 1e-9
        x, _, heights = sample(terrain, f"slope:{SLOPES[name]:g}")
        rise = np.polyfit(x.ravel(), heights.ravel(), 1)[0]
        assert math.degrees(math.atan(rise)) == pytest.approx(SLOPES[name], abs=1e-6)
    levels = {patch.level: patch.name for patch in terrain.patches}
    assert sorted(levels) == list(range(len(LEVELS)))


def test_robots_fall_on_each_patch_and_lie_on_it(op3, terrain, terrain_world):
    pool = make_terrain_pool(terrain_world, terrain, 3, np.random.default_rng(1))
    assert np.bincount(pool.level).tolist() == [6, 6, 6, 6]
    root = op3.layout(terrain_world.model).root_position
    # The flat patch is alone on its level and has twice as many falls.
    rows = np.split(pool.qpos, 6 + 3 * np.arange(len(terrain.patches) - 1))
    for patch, falls in zip(terrain.patches, rows, strict=True):
        for qpos in falls:
            assert patch.region.spans(qpos[root])
            x, y, z = qpos[root]
            over = z - terrain.scene.ground.height(x, y)
            assert -0.05 < over < 0.25


def test_standing_robots_stand_upright_and_with_their_soles_on_the_terrain(
    op3, terrain, terrain_world
):
    model = terrain_world.model
    data, layout = mujoco.MjData(model), op3.layout(model)
    squat = place(op3, model, op3.standing)
    squat[layout.root_position][2] -= 0.02
    lying = place(op3, model, op3.standing)
    lying[layout.root_position][2] = 0.05
    rises = np.stack([squat, lying])
    upright = quaternion.rotate(op3.standing.orientation, UP)[2]
    stands = sample_terrain_stands(terrain_world, terrain, rises, np.random.default_rng(2))
    assert set(stands.level.tolist()) == set(range(len(LEVELS)))
    for qpos in stands.qpos[::40]:
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        spine = quaternion.rotate(qpos[layout.root_orientation], UP)
        assert spine[2] == pytest.approx(upright, abs=1e-6)
        assert np.min(data.contact.dist, initial=0.0) > -0.002
        for name in op3.sole_sites:
            x, y, z = data.site(name).xpos
            assert z - terrain.scene.ground.height(x, y) == pytest.approx(0.0, abs=0.03)
