"""Separation: moves limbs apart that touch each other in a rollout."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.world import World
from robots.body.overlap import find_self_contacts
from robots.quaternion import Array
from robots.smooth_step import smooth_step

MARGINS = (0.005, 0.01, 0.002)  # m, in turn
FADES = (0.15, 0.4)  # s
END = 0.3  # s before the last target in which a shift fades out
LARGEST_SHIFT = 0.15  # rad of a joint, for one touch
GAP = 0.1  # s between two touches of the same bodies that count as one


@dataclass(frozen=True, kw_only=True, eq=False)
class _Touch:
    """Two bodies of the robot that touch for a while."""

    bodies: tuple[int, int]
    first: int
    """First frame."""
    last: int
    depth: float
    """Largest depth [m]."""
    gradient: Array
    """Gradient of their distance by the joint angles at the deepest frame [m/rad], (n,)."""

    def followed_by(self, later: _Touch) -> _Touch:
        """Return both as one touch."""
        deeper = later if later.depth > self.depth else self
        return replace(deeper, first=self.first, last=later.last)


class Separation:
    """Shifts joint angles along the gradients of the distances between the bodies that touch.

    A touch of depth d is answered by the smallest shift of the joint angles that makes the
    distance a margin m: Δq = Jᵀ(d + m) / JJᵀ, where J is the gradient of the distance. It fades
    in before the touch and out after it.
    """

    def __init__(self, world: World) -> None:
        self._robot, self._model = world.robot, world.model
        self._data = mujoco.MjData(world.model)
        self._dof = world.robot.layout(world.model).dof

    def shift(self, qpos: Array, overlap: Array, length: int, margin: float) -> list[Array]:
        """Return shifts of the first joint targets [rad], each (length, n), to choose from.

        They differ in how long they fade, and in whether the other side of the body moves
        likewise. The last target is not shifted: a rise ends in the stance. The rollout had MuJoCo
        positions (T, nq) and depths of self-penetration (T,) [m]; a margin [m] shall remain.
        """
        touches = self._find_touches(qpos, overlap)
        left = (length - 1 - np.arange(length)) * self._robot.control_period
        end = np.clip(left / END, 0.0, 1.0)[:, None]
        shifts = []
        for fade in FADES:
            shift = np.zeros((length, self._robot.n))
            for touch in touches:
                J = touch.gradient
                change = J * (touch.depth + margin) / (J @ J + 1e-6)
                change *= min(1.0, LARGEST_SHIFT / float(np.abs(change).max() + 1e-9))
                shift += self._fade(touch, length, fade)[:, None] * change
            shift *= end
            shifts += [shift + self._robot.mirror_joints(shift), shift]
        return shifts

    def _find_touches(self, qpos: Array, overlap: Array) -> list[_Touch]:
        touches: dict[tuple[int, int], list[_Touch]] = {}
        gap = round(GAP / self._robot.control_period)
        for frame in np.flatnonzero(overlap > 0.0):
            for touch in self._measure(qpos[frame], int(frame)):
                known = touches.setdefault(touch.bodies, [])
                if known and frame - known[-1].last <= gap:
                    known[-1] = known[-1].followed_by(touch)
                else:
                    known.append(touch)
        return [touch for known in touches.values() for touch in known]

    def _measure(self, qpos: Array, frame: int) -> list[_Touch]:
        """Return each contact of the robot with itself in a frame."""
        model, data = self._model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        touches = []
        for k in np.flatnonzero(find_self_contacts(model, data)):
            contact = data.contact[int(k)]
            a, b = (int(body) for body in model.geom_bodyid[contact.geom])
            if contact.dist < 0.0:
                normal = contact.frame[:3]
                apart = self._jacobian(contact.pos, b) - self._jacobian(contact.pos, a)
                depth = -float(contact.dist)
                touches.append(
                    _Touch(
                        bodies=(a, b), first=frame, last=frame, depth=depth, gradient=normal @ apart
                    )
                )
        return touches

    def _jacobian(self, point: NDArray[np.float64], body: int) -> Array:
        """Return the Jacobian of a point of a body, (3, n)."""
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jac(self._model, self._data, jacobian, None, point, body)
        return jacobian[:, self._dof]

    def _fade(self, touch: _Touch, length: int, fade: float) -> Array:
        """Return weights that are 1 while bodies touch and fade before and after, (length,)."""
        time = np.arange(length)
        away = np.maximum(touch.first - time, time - touch.last) * self._robot.control_period
        return smooth_step(1.0 - away / fade)
