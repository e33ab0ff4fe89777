"""A robot rises where it is not alone on a level floor."""

import numpy as np
import pytest

import humanoid_getup as hg
from drivers import SafetyGuard
from drivers.dynamixel.backend import DynamixelBackend
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.scenes.named_scenes import load_scene
from robots import Robot


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["wall", "slope:5"])
def test_a_robot_rises_in_a_scene(op3: Robot, scene: str):
    world = hg.World(op3, load_scene(scene, op3))
    fall = sample_falls(world, {"prone": 1}, np.random.default_rng(1))[0]
    with hg.Twin(world, fall.posture) as twin:
        result = hg.get_up(twin, hg.PlannedRise(world))
        assert result.stood, result.reason
        root = twin.truth.posture.position
        assert np.hypot(*(root - fall.posture.position)[:2]) < 0.8
    assert result.attempts[0].outcome is not None


@pytest.mark.slow  # about a minute
def test_a_robot_under_a_table_crawls_out_and_rises(op3: Robot):
    world = hg.World(op3, load_scene("table", op3))
    fall = sample_falls(world, {"right": 1}, np.random.default_rng(1))[0]
    with hg.Twin(world, fall.posture) as twin:
        result = hg.get_up(twin, hg.PlannedRise(world))
        assert result.stood, result.reason
        root = twin.truth.posture.position
    assert result.figures().moves > 0
    top = next(obstacle for obstacle in world.scene.obstacles if obstacle.name == "top")
    assert np.any(np.abs(root - top.position)[:2] > top.half_size[:2])


def test_a_robot_that_does_not_know_its_place_is_refused(op3: Robot):
    world = hg.World(op3, load_scene("wall", op3))
    guard = SafetyGuard(DynamixelBackend(op3, {"main": "/dev/none"}))
    with pytest.raises(ValueError, match="scene 'wall' is not the same everywhere"):
        hg.get_up(guard, hg.PlannedRise(world))
