"""The virtual actuator: a desired force on the center of mass, produced by the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.rollouts.play import Feedback
from humanoid_getup.simulation.world import World
from robots.quaternion import Array

SUPPORT_FORCE_SHARE = 0.5  # of the robot's weight, the largest desired force
STIFFNESS_RATE = 4.0  # rad/s, natural frequency of the virtual spring and damper
DAMPING_RATIO = 0.7


@dataclass(frozen=True, kw_only=True)
class LimbMap:
    """Limb, body and mass that each joint moves."""

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


def compute_force(
    com: Array, com_velocity: Array, reference: Array, reference_velocity: Array, mass: float
) -> Array:
    """Compute the desired force on the center of mass [N], (..., 3).

    It is a spring and damper to the reference, limited to half of the weight.
    """
    spring = STIFFNESS_RATE**2 * (reference - com)
    damper = 2.0 * DAMPING_RATIO * STIFFNESS_RATE * (reference_velocity - com_velocity)
    force = mass * (spring + damper)
    largest = SUPPORT_FORCE_SHARE * mass * 9.81
    size = np.linalg.norm(force, axis=-1, keepdims=True)
    return force * np.minimum(1.0, largest / np.maximum(size, 1e-9))


def compute_torque(state: Feedback, force: Array, limbs: LimbMap) -> Array:
    """Convert forces on the centers of mass [N], (N, 3), to joint torques [N·m], (N, n).

    With its contact point p fixed to the world and the torso's attitude kept, turning
    joint j (axis a, anchor o, the subtree below it of mass share m and center c) by dq moves
    the center of mass by
    ``(m a x (c - o) - a x (p - o)) dq``: that is the column of the Jacobian J, and the
    torques are J^T f, section 4.3 of [Lin12]. Limbs that touch the world share the force;
    the joints of the others get none, and no external force ever acts.
    """
    point = state.limb_point[:, limbs.limb]  # (N, n, 3)
    below = state.com[:, limbs.body]  # (N, n, 3)
    shift = limbs.mass_share[:, None] * _cross(state.axis, below - state.anchor)
    jacobian = shift - _cross(state.axis, point - state.anchor)
    supports = state.limb_touch.sum(axis=1, keepdims=True)
    share = state.limb_touch[:, limbs.limb] / np.maximum(supports, 1)  # (N, n)
    return share * np.einsum("nji,ni->nj", jacobian, force)


def _cross(a: Array, b: Array) -> Array:
    """Compute cross products (..., 3); twice as fast as ``np.cross`` on small arrays."""
    y, z = [1, 2, 0], [2, 0, 1]
    return a[..., y] * b[..., z] - a[..., z] * b[..., y]
