"""Ends of limbs: the sole or, without one, a point beyond the last joint."""

from __future__ import annotations

import mujoco

from robots.quaternion import Array


def locate_end(data: mujoco.MjData, joint: int) -> Array:
    """Locate the end of the bodies that a joint moves, in the world, (3,) [m].

    It is taken to be as far beyond the center of mass as the joint is before it.

    Args:
        data: Its kinematics and centers of mass.
        joint: The last one of a limb, or the one at which its last part begins.
    """
    body = data.model.jnt_bodyid[joint]
    return 2.0 * data.subtree_com[body] - data.xanchor[joint]
