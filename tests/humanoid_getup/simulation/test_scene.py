"""A scene is the robot on its ground, among its obstacles."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.simulation.scene import Obstacle, Scene, load_scene
from robots import load_robot

ROBOT = load_robot("op3")


def test_an_unknown_scene_is_refused_with_what_is_allowed():
    with pytest.raises(ValueError, match=r"unknown scene 'moon': expected flat"):
        load_scene("moon")


def test_the_ground_decides_the_friction_under_every_sole():
    model = Scene(name="ice", friction=0.1).compile(ROBOT)
    data = mujoco.MjData(model)
    layout = ROBOT.layout(model)
    data.qpos[layout.root_qpos : layout.root_qpos + 3] = ROBOT.standing.position
    data.qpos[layout.root_qpos + 3 : layout.root_qpos + 7] = ROBOT.standing.orientation
    data.qpos[layout.qpos] = ROBOT.standing.joint_pos
    data.qpos[layout.root_qpos + 2] -= 1e-4
    mujoco.mj_forward(model, data)
    assert data.ncon == 8  # four corners of each sole
    np.testing.assert_allclose(data.contact.friction[:, 0], 0.1)


def test_an_obstacle_is_where_it_was_put():
    beam = Obstacle(
        name="beam", start=np.array([0.5, -1.0, 0.1]), end=np.array([0.5, 1.0, 0.1]), radius=0.05
    )
    ball = Obstacle(name="ball", start=np.ones(3), end=np.ones(3), radius=0.2)
    model = Scene(name="beam", obstacles=(beam, ball)).compile(ROBOT)
    np.testing.assert_allclose(model.geom("beam").pos, [0.5, 0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(model.geom("beam").size[:2], [0.05, 1.0])
    np.testing.assert_allclose(model.geom("ball").pos, [1.0, 1.0, 1.0])
    assert beam.distance(np.array([0.5, 2.0, 0.1])) == pytest.approx(1.0)
    assert beam.distance(np.array([0.2, 0.3, 0.1])) == pytest.approx(0.3)


def test_an_obstacle_without_size_is_refused():
    with pytest.raises(ValueError, match=r"radius is 0\.0 m, expected > 0"):
        Obstacle(name="dot", start=np.zeros(3), end=np.zeros(3), radius=0.0)
