"""Ground fit: adapts the legs of a motion to ground that is not level."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.body.parts import leg_length
from robots.kinematics import place_postures
from robots.quaternion import Array
from robots.smooth_step import smooth_step

FLAT_FROM, FLAT_AT = 0.7, 0.95  # vertical part of a sole's normal: not on the ground, on it
PLACE_COST = 5.0  # of a sole that misses its place by 1 m, beside its tilt by 1 rad
EFFORT_COST = 0.05  # of turning a joint by 1 rad
STEPS = 3  # of Gauss-Newton
LOWER = 0.5  # share of the way from the mean height of the soles' ground to the lowest
EVERY = 5  # control periods between two postures that are fitted
UP = np.array([0.0, 0.0, 1.0])
FOOT_REACH = 0.15  # leg lengths over which the ground's tilt under a foot is averaged


class GroundFit:
    """Places the soles of a motion, made on level ground, flat on the scene's ground.

    An addition to [Lin12], whose slope is left to the dynamics filter: the body stays as upright
    as in the motion, ankles take up the tilt, and legs the difference in height.
    """

    def __init__(self, world: World) -> None:
        self._world, self._reach = world, FOOT_REACH * leg_length(world.robot)
        self._data = mujoco.MjData(world.model)
        layout = world.robot.layout(world.model)
        self._dof, self._qpos = layout.dof, layout.qpos
        self._soles = [world.model.site(name).id for name in world.robot.sole_sites]

    def shift(self, position: Array, orientation: Array, joint_pos: Array) -> Array:
        """Compute the corrections of joint angles (T, n) for a motion (T, ...) on level ground.

        Its postures have the place and heading that the robot will have.
        """
        count = len(joint_pos)
        if self._world.scene.ground.is_level:
            return np.zeros_like(joint_pos)
        rows = np.unique(np.append(np.arange(0, count, EVERY), count - 1))
        robot, model = self._world.robot, self._world.model
        qpos = place_postures(robot, model, position[rows], orientation[rows], joint_pos[rows])
        fitted = np.array([self.shift_legs(q) for q in qpos])
        return np.stack([np.interp(np.arange(count), rows, column) for column in fitted.T], axis=1)

    def measure_level(self, qpos: Array) -> float:
        """Measure the height of the ground on which a robot would stand [m].

        ``qpos`` are MuJoCo positions, (nq,), of a robot on level ground of height 0.
        """
        position, _, share = self._find_soles(qpos)
        height = self._world.scene.ground.height(position[:, 0], position[:, 1])
        mean = float(share @ height / max(share.sum(), 1e-9))
        return mean + LOWER * (float(np.min(share * (height - mean))))

    def _find_soles(self, qpos: Array) -> tuple[Array, Array, Array]:
        """Find places (2, 3) and orientations (2, 9) of soles, and how flat each is, (2,)."""
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._world.model, data)
        position, matrix = data.site_xpos[self._soles], data.site_xmat[self._soles]
        return position, matrix, smooth_step((matrix[:, 8] - FLAT_FROM) / (FLAT_AT - FLAT_FROM))

    def shift_legs(self, qpos: Array) -> Array:
        """Compute the corrections of the joint angles of one posture, (n,).

        ``qpos`` are MuJoCo positions, (nq,), at the height that `measure_level` yields.
        """
        model, data = self._world.model, self._data
        position, matrix, share = self._find_soles(qpos)
        shift = np.zeros(len(self._dof))
        if not share.any():
            return shift
        wanted_position = position.copy()
        wanted_position[:, 2] += self._rise(position, share)
        wanted_normal = self._tilt(position, matrix[:, [2, 5, 8]], share)
        slide, turn = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        for _ in range(STEPS):
            mujoco.mj_comPos(model, data)
            step = np.zeros(len(self._dof))
            for i, sole in enumerate(self._soles):
                mujoco.mj_jacSite(model, data, slide, turn, sole)
                off = np.cross(data.site_xmat[sole][[2, 5, 8]], wanted_normal[i]).astype(float)
                miss = wanted_position[i] - data.site_xpos[sole]
                step += _solve(slide[:, self._dof], turn[:2, self._dof], off[:2], miss, shift)
            shift += step
            data.qpos[self._qpos] += step
            mujoco.mj_kinematics(model, data)
        return shift

    def _rise(self, position: Array, share: Array) -> Array:
        """Compute by how much soles (2, 3) come up to their ground, from that of the robot, (2,).

        The robot comes to stand between the mean height of the ground under the soles that are on
        it, and the lowest: a leg bends further more easily than it stretches.
        """
        height = self._world.scene.ground.height(position[:, 0], position[:, 1])
        mean = float(share @ height / share.sum())
        lowest = float(np.min(share * (height - mean))) + mean
        return share * (height - mean - LOWER * (lowest - mean))

    def _tilt(self, position: Array, normal: Array, share: Array) -> Array:
        """Turn the normals (2, 3) of soles as much as the ground is tilted under them."""
        ground = self._world.scene.ground.normal(position[:, 0], position[:, 1], self._reach)
        axis = np.cross(UP, ground)
        sine = np.linalg.norm(axis, axis=1)
        axis /= np.maximum(sine, 1e-9)[:, None]
        turn = quaternion.from_axis_angle(axis, share * np.arctan2(sine, ground[:, 2]))
        return quaternion.rotate(turn, normal)


def _solve(slide: Array, turn: Array, off: Array, miss: Array, shift: Array) -> Array:
    """Find the step (n,) of joints that bring a sole to its place and tilt.

    ``slide`` (3, n) and ``turn`` (2, n) are the sole's Jacobians, ``miss`` (3,) and ``off`` (2,)
    the remaining errors of place and tilt, ``shift`` (n,) the correction so far.
    """
    moving = np.any(turn != 0.0, axis=0) | np.any(slide != 0.0, axis=0)
    rows = np.concatenate([turn, PLACE_COST * slide, EFFORT_COST * np.eye(len(moving))])
    right = np.concatenate([off, PLACE_COST * miss, -EFFORT_COST * shift])
    out = np.zeros(len(moving))
    out[moving] = np.linalg.lstsq(rows[:, moving], right, rcond=None)[0]
    return out
