"""A limb whose axis is in a box is found, by its contact or as a crossing."""

import mujoco
import numpy as np

from humanoid_getup.scenes.obstacle import Crossings
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place

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
