"""Which bodies touch the ground: found from the posture alone."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.simulation.touch import find_touching_bodies
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import lowest_point, place


@pytest.fixture(scope="module")
def world(tiny) -> World:
    return World(tiny)


def on_the_ground(world: World, axis: tuple[float, float, float], degrees: float):
    """Turn the standing robot about an axis and put its lowest point 1 mm into the ground."""
    turn = quaternion.from_axis_angle(np.array(axis), np.radians(degrees))
    qpos = place(world.robot, world.model, replace(world.robot.standing, orientation=turn))
    qpos[2] -= lowest_point(world.model, qpos) + 0.001
    return qpos


def test_feet_are_not_reported(world: World):
    assert find_touching_bodies(world, on_the_ground(world, (1.0, 0.0, 0.0), 0.0)) == ()


def test_a_robot_on_its_head_stands_on_its_torso(world: World):
    # The legs end at the height of the hips, 5 cm below the top of the torso.
    assert find_touching_bodies(world, on_the_ground(world, (1.0, 0.0, 0.0), 180.0)) == ("torso",)


def test_nothing_touches_in_the_air(world: World):
    qpos = on_the_ground(world, (1.0, 0.0, 0.0), 180.0)
    qpos[2] += 0.5
    assert find_touching_bodies(world, qpos) == ()
