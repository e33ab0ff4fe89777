"""The virtual actuator: a force wished on the center of mass, made by the joints alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.simulation.rollout import Feedback
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

SUPPORT_FORCE_SHARE = 0.5  # of the robot's weight, the most that is ever wished for
STIFFNESS_RATE = 4.0  # rad/s, how fast the wish would bring the center of mass back
DAMPING_RATIO = 0.7


@dataclass(frozen=True, kw_only=True)
class LimbMap:
    """Which joint moves which limb, and how much mass hangs on each joint."""

    limb: np.ndarray
    """Limb of each joint, shape (n,)."""
    body: np.ndarray
    """Body that each joint moves, shape (n,)."""
    mass_share: Array
    """Share of the robot's mass in the subtree of each joint, shape (n,)."""
    mass: float
    """Mass of the robot [kg]."""

    @staticmethod
    def of(world: World) -> LimbMap:
        """Read the map from a world's model."""
        model, robot = world.model, world.robot
        body = np.array([int(model.joint(name).bodyid[0]) for name in robot.joint_names])
        roots = [model.body(name).id for name in world.limbs]
        limb = np.array([roots.index(_ancestor(model.body_parentid, b, roots)) for b in body])
        mass = float(model.body_subtreemass[model.body(robot.torso).id])
        return LimbMap(
            limb=limb, body=body, mass_share=model.body_subtreemass[body] / mass, mass=mass
        )


def _ancestor(parent: np.ndarray, body: int, roots: list[int]) -> int:
    while body not in roots:
        body = int(parent[body])
    return body


def compute_wish(
    com: Array, com_velocity: Array, wanted: Array, wanted_velocity: Array, mass: float
) -> Array:
    """Compute the force wished on the center of mass [N], (..., 3).

    A spring and damper to where the reference has it, cut to half of the weight.
    """
    spring = STIFFNESS_RATE**2 * (wanted - com)
    damper = 2.0 * DAMPING_RATIO * STIFFNESS_RATE * (wanted_velocity - com_velocity)
    force = mass * (spring + damper)
    largest = SUPPORT_FORCE_SHARE * mass * 9.81
    size = np.linalg.norm(force, axis=-1, keepdims=True)
    return force * np.minimum(1.0, largest / np.maximum(size, 1e-9))


def compute_torque(seen: Feedback, force: Array, limbs: LimbMap) -> Array:
    """Turn a force on the center of mass into joint torques [N·m], (N, n).

    With its point of touch p held by the world and the torso's attitude kept, turning
    joint j (axis a, anchor o, the subtree below it of mass share m and center c) by dq moves
    the center of mass by
    ``(m a x (c - o) - a x (p - o)) dq``: that is the column of the Jacobian J, and the
    torques are J^T f, section 4.3 of [Lin12]. Limbs that touch the world share the force;
    the joints of the others get none, and no external force ever acts.

    Args:
        seen: N rollouts at one cycle.
        force: Wanted force on each center of mass [N], (N, 3).
        limbs: Which joint belongs to which limb.
    """
    point = seen.limb_point[:, limbs.limb]  # (N, n, 3)
    below = seen.com[:, limbs.body]  # (N, n, 3)
    shift = limbs.mass_share[:, None] * np.cross(seen.axis, below - seen.anchor)
    jacobian = shift - np.cross(seen.axis, point - seen.anchor)
    helpers = seen.limb_touch.sum(axis=1, keepdims=True)
    share = seen.limb_touch[:, limbs.limb] / np.maximum(helpers, 1)  # (N, n)
    return share * np.einsum("nji,ni->nj", jacobian, force)
