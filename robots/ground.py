"""The ground of every simulation: twin, rollouts and training."""

from __future__ import annotations

import mujoco

GROUND = "ground"
"""Name of its geom."""
GROUND_FRICTION = 0.8
SOLREF = (0.004, 1.0)  # as in the robots' own geoms, so that only friction differs


def add_world_geom(spec: mujoco.MjSpec, name: str, friction: float) -> mujoco.MjsGeom:
    """Add a geom to the world whose friction and stiffness prevail in every contact."""
    geom = spec.worldbody.add_geom(name=name)
    # MuJoCo takes the larger friction of two geoms unless one has priority;
    # a slippery floor must be slippery under every sole.
    geom.priority = 1
    geom.friction[0] = friction
    geom.solref[:2] = SOLREF
    return geom


def add_ground(spec: mujoco.MjSpec, friction: float = GROUND_FRICTION) -> mujoco.MjsGeom:
    """Add a horizontal plane at z = 0."""
    geom = add_world_geom(spec, GROUND, friction)
    geom.type = mujoco.mjtGeom.mjGEOM_PLANE
    geom.size[:] = [0, 0, 0.05]
    return geom
