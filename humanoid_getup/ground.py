"""The ground: how low a robot reaches."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.rotation import Array


def lowest_point(model: mujoco.MjModel, qpos: Array) -> float:
    """Measure the height of the robot's lowest point [m] at MuJoCo positions (nq,).

    Exact for boxes, spheres, capsules, cylinders and ellipsoids; a mesh counts as its box.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    own = model.body_weldid[model.geom_bodyid] != 0
    kind, size = model.geom_type[own], model.geom_size[own]
    down = data.geom_xmat[own][:, 6:9]  # the world's z axis in each geom's frame
    along, radius = np.abs(down[:, 2]) * size[:, 1], size[:, 0]
    reaches = {
        mujoco.mjtGeom.mjGEOM_SPHERE: radius,
        mujoco.mjtGeom.mjGEOM_CAPSULE: radius + along,
        mujoco.mjtGeom.mjGEOM_CYLINDER: radius * np.hypot(down[:, 0], down[:, 1]) + along,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: np.linalg.norm(down * size, axis=1),
    }
    reach = np.sum(np.abs(down) * size, axis=1)  # of a box
    for shape, of_shape in reaches.items():
        reach = np.where(kind == shape, of_shape, reach)
    return float(np.min(data.geom_xpos[own][:, 2] - reach))
