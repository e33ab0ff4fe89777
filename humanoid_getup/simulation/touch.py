"""Touch: which bodies of a robot touch the world in a posture."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.simulation.world import World
from robots.quaternion import Array


def find_touching_bodies(world: World, qpos: Array) -> tuple[str, ...]:
    """Find the bodies besides the feet that touch the world at MuJoCo positions (nq,)."""
    model, data = world.model, mujoco.MjData(world.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    feet = {int(model.site(site).bodyid[0]) for site in world.robot.sole_sites}
    is_world = world.is_world_geom[data.contact.geom]
    geoms = data.contact.geom[is_world.any(axis=1)][~is_world[is_world.any(axis=1)]]
    bodies = np.unique(model.geom_bodyid[geoms])
    return tuple(model.body(body).name for body in bodies if int(body) not in feet)
