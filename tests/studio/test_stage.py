import numpy as np
import pytest

pytest.importorskip("mjviser", reason="needs the studio extra")

from humanoid_getup.simulation.world import World
from humanoid_getup.studio.stage import build_model, contains
from robots import Robot, load_robot
from robots.body.shapes import find_hull
from robots.kinematics import place

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 2.0], [1.0, 0.5]])


def test_the_support_is_the_hull_of_the_contacts_if_there_are_enough():
    hull = find_hull(SQUARE)
    assert hull is not None
    corners = sorted(map(tuple, SQUARE[hull.vertices]))
    assert corners == [(0.0, 0.0), (0.0, 2.0), (2.0, 0.0), (2.0, 2.0)]
    assert contains(hull, np.array([1.9, 0.1]))
    assert not contains(hull, np.array([2.1, 0.1]))
    assert not contains(hull, np.array([1.0, -0.1]))
    for few in (SQUARE[:0], SQUARE[:2], np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])):
        assert find_hull(few) is None


@pytest.mark.parametrize("name", ["op3", "toddlerbot", "wolfgang", "human"])
def test_the_ghost_has_the_positions_of_the_robot_and_touches_nothing(name: str):
    import mujoco

    robot: Robot = load_robot(name)
    world = World(robot)
    model = build_model(world)
    data, standing = mujoco.MjData(model), place(robot, world.model, robot.standing)
    data.qpos[:] = np.concatenate([standing, standing])
    mujoco.mj_forward(model, data)
    torso, ghost = model.body(robot.torso).id, model.body(f"ghost/{robot.torso}").id
    np.testing.assert_array_equal(data.xpos[torso], data.xpos[ghost])
    touching = model.body_rootid[model.geom_bodyid[data.contact.geom]]
    assert ghost not in touching
    assert torso in touching
