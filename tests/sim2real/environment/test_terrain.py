"""The terrain has every patch that a scene of its name has, and opens level by level."""

import math

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.scenes.named_scenes import ROUGHNESS, TILE
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import leg_length
from sim2real.environment.initial_states import StartPool, make_terrain_pool
from sim2real.environment.terrain import (
    LEVELS,
    SLOPES,
    TO_OPEN,
    Terrain,
    TerrainCurriculum,
    build_terrain,
)
from sim2real.environment.training_world import build_training_world

PHYSICS_STEP = 0.006  # s


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
    assert np.bincount(pool.level).tolist() == [3, 6, 6, 6]
    root = op3.layout(terrain_world.model).root_position
    for number, patch in enumerate(terrain.patches):
        for qpos in pool.qpos[3 * number : 3 * number + 3]:
            assert patch.region.spans(qpos[root])
            x, y, z = qpos[root]
            over = z - terrain.scene.ground.height(x, y)
            assert -0.05 < over < 0.25
    assert TILE * leg_length(op3) > 0.1


def test_levels_open_one_by_one_after_enough_successes():
    levels = np.array([0, 1, 2, 3])
    curriculum = TerrainCurriculum(levels)
    curriculum.note(np.array([1, 2]), np.array([True, True]))
    assert (curriculum.open, curriculum.successes) == (0, 0)  # only those of level 0 count
    for _ in range(TO_OPEN):
        curriculum.note(np.array([0, 0]), np.array([True, False]))
    assert curriculum.open == 1
    for level in (1, 2, 3):
        curriculum.note(np.full(3 * TO_OPEN, level), np.ones(3 * TO_OPEN, dtype=bool))
    assert curriculum.open == 3
    again = TerrainCurriculum(levels)
    again.restore_state(curriculum.save_state())
    assert (again.open, again.successes) == (curriculum.open, curriculum.successes)


def test_only_falls_of_open_levels_are_drawn():
    pool = StartPool.of(np.zeros((40, 7)), np.arange(40) % 4)
    rng = np.random.default_rng(0)
    for highest in range(4):
        drawn = pool.level[pool.draw(500, rng, highest)]
        assert set(drawn.tolist()) == set(range(highest + 1))
