"""A robot is put on what is under it, wherever that is."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.obstacle import make_capsule
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.clearance import FINE, Clearance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import lowest_point, place


@pytest.fixture(params=["flat", "slope:15", "rough:hard", "low-bed-a"])
def scene(request, op3: Robot) -> World:
    return World(op3, load_scene(request.param, op3))


def test_a_resting_robot_touches_and_does_not_press(scene: World, op3: Robot):
    clearance = Clearance(scene)
    qpos = place(op3, scene.model, op3.standing)
    for height in (-0.3, 0.0, 0.5):  # whatever it was before
        lifted = qpos.copy()
        lifted[op3.layout(scene.model).root_qpos + 2] += height
        resting = clearance.rest(lifted)
        assert clearance.measure_overlap(resting) <= 1e-9
        pressed = resting.copy()
        pressed[op3.layout(scene.model).root_qpos + 2] -= 2.0 * FINE
        assert 0.0 < clearance.measure_overlap(pressed) <= 2.0 * FINE + 1e-9


def test_a_robot_is_put_so_far_above_or_so_deep_in(scene: World, op3: Robot):
    clearance, root = Clearance(scene), op3.layout(scene.model).root_qpos
    qpos = place(op3, scene.model, op3.standing)
    resting = clearance.rest(qpos)[root + 2]
    assert clearance.rest(qpos, 0.02)[root + 2] - resting == pytest.approx(0.02, abs=2 * FINE)
    assert clearance.measure_overlap(clearance.rest(qpos, -0.002)) == pytest.approx(
        0.002, abs=2 * FINE
    )


def test_a_robot_under_a_roof_is_put_under_it_and_not_on_it(op3: Robot):
    roof = make_capsule("roof", np.array([-1.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]), 0.1)
    world = World(op3, Scene(name="roof", obstacles=(roof,)))
    resting = Clearance(world).rest(place(op3, world.model, op3.standing))
    assert abs(lowest_point(world.model, resting)) < 2.0 * FINE


def test_a_steady_robot_stays_where_it_was_put(op3: Robot):
    world = World(op3, load_scene("slope:10", op3))
    data = mujoco.MjData(world.model)
    data.qpos[:] = Clearance(world).rest(place(op3, world.model, op3.standing))
    before = float(data.qpos[2])
    mujoco.mj_step(world.model, data, 5)
    assert data.qpos[2] == pytest.approx(before, abs=0.002)
