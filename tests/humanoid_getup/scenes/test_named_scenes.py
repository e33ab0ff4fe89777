"""Named scenes: each compiles, slopes are as steep as they say, and rough ground has its seed."""

import numpy as np
import pytest

from humanoid_getup.scenes.named_scenes import (
    ROUGHNESS,
    load_scene,
)
from robots import Robot
from robots.body.parts import leg_length

X, Y = np.meshgrid(np.linspace(-0.6, 0.6, 25), np.linspace(-0.6, 0.6, 25))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("moon", "unknown scene 'moon': expected beam, .*slope:10, rough:easy, .*or a .toml file"),
        ("slope:31", "scene slope:31: expected degrees from -30 to 30"),
        ("slope:steep", "scene slope:steep: expected degrees"),
        ("slope:nan", "scene slope:nan: expected degrees"),
        ("rough:", "scene rough:: expected rough:easy, rough:medium, rough:hard"),
        ("../named/flat", "unknown scene '../named/flat'"),
    ],
)
def test_an_unknown_scene_is_refused_with_what_is_allowed(op3: Robot, name: str, message: str):
    with pytest.raises(ValueError, match=message):
        load_scene(name, op3)


def test_the_same_seed_is_the_same_rough_ground(op3: Robot):
    heights = [
        load_scene("rough:hard", op3, seed).ground.height(np.array([0.3]), np.array([0.2]))
        for seed in (0, 0, 1)
    ]
    assert heights[0] == heights[1] != heights[2]


@pytest.mark.parametrize("degrees", [-30.0, -5.0, 0.0, 12.5, 30.0])
def test_a_slope_is_as_steep_as_its_name(op3: Robot, degrees: float):
    height = load_scene(f"slope:{degrees:g}", op3).ground.height(X, Y)
    rise, aside = np.gradient(height, X[0], axis=1), np.ptp(height, axis=0)
    np.testing.assert_allclose(rise, np.tan(np.radians(degrees)), atol=1e-9)
    np.testing.assert_allclose(aside, 0.0, atol=1e-9)


@pytest.mark.parametrize(("level", "share"), ROUGHNESS.items())
def test_rough_ground_is_as_uneven_as_its_level(op3: Robot, level: str, share: float):
    heights = [load_scene(f"rough:{level}", op3, seed).ground.height(X, Y) for seed in range(5)]
    most = np.abs(heights).max()
    assert 0.5 * share * leg_length(op3) < most <= share * leg_length(op3) + 1e-9
