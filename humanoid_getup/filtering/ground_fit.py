"""Ground fit: legs that put their soles on the ground that is there, not on level ground."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.simulation.world import World
from robots.kinematics import leg_length, place_postures
from robots.quaternion import Array

FLAT_FROM, FLAT_AT = 0.7, 0.95  # vertical part of a sole's normal: not on the ground, on it
SLIDE_COST = 5.0  # of moving a sole by 1 m, beside missing its tilt by 1 rad
EFFORT_COST = 0.05  # of turning a joint by 1 rad
EVERY = 5  # control periods between two postures that are fitted
FOOT_REACH = 0.15  # leg lengths over which the ground's tilt under a foot is averaged


class GroundFit:
    """Tilts soles that are flat on level ground in a motion by the tilt of the scene's ground.

    An addition to [Lin12], whose slope is left to the dynamics filter: the body stays as upright
    as in the motion, and mostly ankles adapt.
    """

    def __init__(self, world: World) -> None:
        self._world, self._reach = world, FOOT_REACH * leg_length(world.robot)
        self._data = mujoco.MjData(world.model)
        layout = world.robot.layout(world.model)
        self._dof = layout.dof
        self._soles = [world.model.site(name).id for name in world.robot.sole_sites]

    def shift(self, position: Array, orientation: Array, joint_pos: Array) -> Array:
        """Compute what to add to the joint angles of a motion (T, ...) on level ground, (T, n).

        Its postures have the place and heading that the robot will have.
        """
        count = len(joint_pos)
        if self._world.scene.ground.is_level:
            return np.zeros_like(joint_pos)
        rows = np.unique(np.append(np.arange(0, count, EVERY), count - 1))
        robot, model = self._world.robot, self._world.model
        qpos = place_postures(robot, model, position[rows], orientation[rows], joint_pos[rows])
        fitted = np.array([self._fit(q) for q in qpos])
        return np.stack([np.interp(np.arange(count), rows, column) for column in fitted.T], axis=1)

    def _fit(self, qpos: Array) -> Array:
        """Compute the shift of one posture, (n,), at MuJoCo positions (nq,)."""
        model, data = self._world.model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        shift = np.zeros(len(self._dof))
        slide, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        for sole in self._soles:
            mujoco.mj_jacSite(model, data, slide, turn, sole)
            wanted = self._tilt(data.site_xpos[sole], data.site_xmat[sole][8])
            shift += _solve(slide[:, self._dof], turn[:2, self._dof], wanted)
        return shift

    def _tilt(self, at: Array, upward: float) -> Array:
        """Compute the turn about the world's x and y [rad] that a sole needs, (2,)."""
        share = np.clip((upward - FLAT_FROM) / (FLAT_AT - FLAT_FROM), 0.0, 1.0)
        normal = self._world.scene.ground.normal(at[0], at[1], self._reach)
        angle = float(np.arctan2(np.hypot(normal[0], normal[1]), normal[2]))
        axis = np.array([-normal[1], normal[0]])  # z cross normal
        length = float(np.linalg.norm(axis))
        if share == 0.0 or length < 1e-9:
            return np.zeros(2)
        return share * share * (3.0 - 2.0 * share) * angle * axis / length


def _solve(slide: Array, turn: Array, wanted: Array) -> Array:
    """Find the joint turns (n,) that tilt a sole and hardly move it.

    ``slide`` (3, n) and ``turn`` (2, n) are the sole's Jacobians, ``wanted`` (2,) its turn.
    """
    moving = np.any(turn != 0.0, axis=0) | np.any(slide != 0.0, axis=0)
    rows = np.concatenate([turn, SLIDE_COST * slide, EFFORT_COST * np.eye(len(moving))])
    right = np.concatenate([wanted, np.zeros(3 + len(moving))])
    solved = np.linalg.lstsq(rows[:, moving], right, rcond=None)[0]
    out = np.zeros(len(moving))
    out[moving] = solved
    return out
