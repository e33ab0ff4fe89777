"""A height map is the ground as the robot faces it, over its mean."""

import numpy as np
import pytest

from humanoid_getup.policy.observation import MAP
from humanoid_getup.scenes.ground import HeightField, Slope
from humanoid_getup.style.features import AROUND
from humanoid_getup.style.height_map import FORWARD, LEFT, measure_height_map
from robots import Robot, quaternion

UP = np.array([0.0, 0.0, 1.0])


def turned(angle: float):
    return quaternion.from_axis_angle(UP[None], np.array([angle]))


@pytest.mark.parametrize("lying", [(0.0, 0.0), (0.0, -1.4), (0.0, 1.5), (1.2, 0.3)])
@pytest.mark.parametrize("heading", [0.0, 1.0, np.pi])
def test_a_slope_rises_where_the_torso_faces_it(op3: Robot, lying, heading):
    """However the robot lies: only its heading counts."""
    roll, pitch = lying
    axis = np.array([[roll, pitch, 0.0]])
    angle = np.linalg.norm(axis, axis=1)
    leaning = quaternion.from_axis_angle(axis / np.maximum(angle, 1e-9)[:, None], angle)
    orientation = quaternion.multiply(turned(heading), leaning)
    found = measure_height_map(op3, Slope(angle=0.2), np.ones((1, 3)), orientation)[0]
    east = FORWARD * np.cos(heading) - LEFT * np.sin(heading)
    assert found == pytest.approx(np.tan(0.2) * AROUND * east)


def test_mirrored_ground_has_the_mirrored_map(op3: Robot):
    along, across = np.random.default_rng(0).uniform(0.0, 0.1, (2, 9))
    heights = along + across[:, np.newaxis]  # alike over both diagonals of a cell
    ground, other = (HeightField(heights=h, cell=0.1) for h in (heights, heights[::-1]))
    place = np.array([[0.1, 0.07, 0.0]])
    found = measure_height_map(op3, ground, place, turned(0.4))
    mirrored = measure_height_map(op3, other, place * [1.0, -1.0, 1.0], turned(-0.4))
    assert found == pytest.approx(MAP(mirrored))
    assert np.ptp(found) > 0.05
