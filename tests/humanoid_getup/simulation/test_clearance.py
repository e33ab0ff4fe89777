"""A robot is put on what is under it, has room to stand, and crosses no wall unnoticed."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.obstacle import Crossings, Obstacle, make_capsule
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.clearance import FINE, Clearance
from humanoid_getup.simulation.placement import ROOM, StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.parts import leg_length
from robots.kinematics import lowest_point, place


@pytest.fixture(params=["flat", "slope:15", "rough:hard", "low-bed-a"])
def scene(request, op3: Robot) -> World:
    return World(op3, load_scene(request.param, op3))


def test_a_resting_robot_touches_and_does_not_press(scene: World, op3: Robot):
    clearance, root = Clearance(scene), op3.layout(scene.model).root_qpos
    qpos = place(op3, scene.model, op3.standing)
    for height in (-0.3, 0.0, 0.5):  # whatever it was before
        lifted = qpos.copy()
        lifted[root + 2] += height
        resting = clearance.rest(lifted)
        assert clearance.measure_overlap(resting) <= 1e-9
        pressed = resting.copy()
        pressed[root + 2] -= 2.0 * FINE
        assert 0.0 < clearance.measure_overlap(pressed) <= 2.0 * FINE + 1e-9
    above, height = clearance.rest(qpos, 0.02)[root + 2], clearance.rest(qpos)[root + 2]
    assert above - height == pytest.approx(0.02, abs=2 * FINE)
    deep = clearance.measure_overlap(clearance.rest(qpos, -0.002))
    assert deep == pytest.approx(0.002, abs=2 * FINE)


def test_a_robot_under_a_roof_is_put_under_it_and_not_on_it(op3: Robot):
    roof = make_capsule("roof", np.array([-1.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]), 0.1)
    world = World(op3, Scene(name="roof", obstacles=(roof,)))
    resting = Clearance(world).rest(place(op3, world.model, op3.standing))
    assert abs(lowest_point(world.model, resting)) < 2.0 * FINE


LOW = np.array([0.0, 0.0, 0.05])


def under(op3: Robot, half: float) -> StandingPlaces:
    """Look from under a roof at three quarters of a leg, ``half`` leg lengths to each side."""
    leg = leg_length(op3)
    roof = Obstacle(
        name="roof",
        kind="box",
        half_size=leg * np.array([half, half, 0.02]),
        position=leg * np.array([0.0, 0.0, 0.77]),
    )
    return StandingPlaces(World(op3, Scene(name="roof", obstacles=(roof,))), LOW)


def test_the_nearest_place_is_beside_the_roof_with_some_room(op3: Robot):
    leg, places = leg_length(op3), under(op3, 1.0)
    assert places.exist
    away = float(places.distance(LOW))
    assert (1.0 + ROOM) * leg < away < (1.0 + ROOM + 1.0) * leg
    assert float(places.distance(np.array([3.0 * leg, 0.0, 0.05]))) < 0.2 * leg


def test_under_a_roof_without_end_there_is_no_place(op3: Robot):
    assert not under(op3, 20.0).exist


ALONG = np.linspace(-1.0, 1.0, 41)


def test_no_limb_passes_through_a_thin_wall_unnoticed(op3: Robot):
    world = World(op3, "wall")
    model, wall = world.model, world.scene.obstacles[0]
    data, box = mujoco.MjData(model), model.geom(wall.name).id
    crossings, clearance, rng = Crossings(model), Clearance(world), np.random.default_rng(0)
    capsules = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)
    deep = silent = 0
    for _ in range(80):
        qpos = place(op3, model, op3.standing)
        layout = op3.layout(model)
        qpos[layout.qpos] = rng.uniform(op3.lower, op3.upper)
        qpos[layout.root_position] = wall.position + rng.uniform(-0.2, 0.2, size=3)
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        crossed = crossings.find(data).tolist()
        for capsule in capsules:
            radius, half = model.geom_size[capsule, :2]
            axis = data.geom_xmat[capsule][[2, 5, 8]]
            points = data.geom_xpos[capsule] + half * ALONG[:, None] * axis
            is_inside = any(wall.contains(point) for point in points)
            pair = np.isin(data.contact.geom, (capsule, box)).all(axis=1)
            depth = np.max(-data.contact.dist[pair], initial=0.0)
            if is_inside:
                deep += 1
                silent += depth < radius
                assert depth >= radius or [capsule, box] in crossed
                assert clearance.measure_overlap(qpos) >= radius
            elif [capsule, box] in crossed:
                # Between two of the points the axis may still touch an edge of the box.
                ends = data.geom_xpos[capsule] + half * np.array([[-1.0], [1.0]]) * axis
                spacing = np.linalg.norm(ends[1] - ends[0]) / (len(ALONG) - 1)
                local = np.abs(points - wall.position) - wall.half_size
                assert local.max(axis=1).min() < spacing
    assert deep > 30
    assert silent > 3, "MuJoCo's own contacts suffice"
