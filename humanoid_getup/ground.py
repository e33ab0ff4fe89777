"""The ground: how low a robot reaches."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.rotation import Array


def lowest_point(model: mujoco.MjModel, qpos: Array) -> float:
    """Measure the height of the robot's lowest point [m] at MuJoCo positions (nq,).

    Exact for boxes, spheres and capsules, which the robots are made of.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    own = model.body_weldid[model.geom_bodyid] != 0
    kind, size = model.geom_type[own], model.geom_size[own]
    down = data.geom_xmat[own][:, 6:9]  # the world's z axis in each geom's frame
    box = np.sum(np.abs(down) * size, axis=1)
    capsule = size[:, 0] + np.abs(down[:, 2]) * size[:, 1]
    reach = np.where(kind == mujoco.mjtGeom.mjGEOM_CAPSULE, capsule, box)
    reach = np.where(kind == mujoco.mjtGeom.mjGEOM_SPHERE, size[:, 0], reach)
    return float(np.min(data.geom_xpos[own][:, 2] - reach))
