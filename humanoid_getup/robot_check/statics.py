"""Statics: the torques that hold a robot in a posture on its soles, without moving."""

from __future__ import annotations

import mujoco
import numpy as np

from robots import Posture, Robot
from robots.quaternion import Array


class Statics:
    """Computes torques of postures in which both soles carry the weight."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._model = robot, robot.spec().compile()
        self._data = mujoco.MjData(self._model)
        self._layout = robot.layout(self._model)
        self._soles = [self._model.site(name).id for name in robot.sole_sites]

    @property
    def weight(self) -> float:
        """Return the weight of the robot [N]."""
        gravity = -float(self._model.opt.gravity[2])
        return gravity * float(self._model.body_subtreemass[self._layout.torso])

    def place_on_soles(self, joint_pos: Array) -> None:
        """Put the robot at joint angles (n,), its first sole level, and look at it."""
        data, layout = self._data, self._layout
        data.qpos[:] = self._model.qpos0
        data.qpos[layout.root_position] = 0.0
        data.qpos[layout.root_orientation] = [1.0, 0.0, 0.0, 0.0]
        data.qpos[layout.qpos] = joint_pos
        data.qvel[:] = 0.0
        mujoco.mj_kinematics(self._model, data)
        orientation = np.zeros(4)
        mujoco.mju_mat2Quat(orientation, data.site_xmat[self._soles[0]].reshape(3, 3).T.ravel())
        data.qpos[layout.root_orientation] = orientation
        mujoco.mj_fwdPosition(self._model, data)
        mujoco.mj_fwdVelocity(self._model, data)

    def measure_torques(self, joint_pos: Array) -> Array:
        """Compute the torques of actuators that hold joint angles on both soles [N·m], (n,).

        The weight acts on each sole in shares that keep the lateral balance, straight below the
        center of mass.
        """
        self.place_on_soles(joint_pos)
        data, model = self._data, self._model
        center = data.subtree_com[self._layout.torso]
        places = np.array([data.site_xpos[sole] for sole in self._soles])
        shares = _share_weight(places[:, 1], float(center[1]))
        torque = data.qfrc_bias.copy()
        jacobian = np.zeros((3, model.nv))
        for sole, place, share in zip(self._soles, places, shares, strict=True):
            point = np.array([center[0], place[1], place[2]])
            body = int(model.site_bodyid[sole])
            mujoco.mj_jac(model, data, jacobian, None, point, body)
            torque -= jacobian.T @ np.array([0.0, 0.0, share * self.weight])
        return np.abs(self._robot.transmission.torque_for_joint(torque[self._layout.dof]))

    def make_posture(self, joint_pos: Array) -> Posture:
        """Return the posture at joint angles (n,) on the ground z = 0, its first sole level."""
        self.place_on_soles(joint_pos)
        low = min(self._data.site_xpos[sole, 2] for sole in self._soles)
        return Posture(
            position=np.array([0.0, 0.0, -low]),
            orientation=self._data.qpos[self._layout.root_orientation].copy(),
            joint_pos=joint_pos,
        )

    def measure_lean(self, joint_pos: Array) -> float:
        """Measure the angle between the torso's z axis and the first sole's [rad]."""
        self.place_on_soles(joint_pos)
        upright = self._data.xmat[self._layout.torso].reshape(3, 3)[2, 2]
        return float(np.arccos(np.clip(upright, -1.0, 1.0)))

    def measure_neck(self, joint_pos: Array) -> float:
        """Measure how high the neck is over the soles, as a share of standing height."""
        self.place_on_soles(joint_pos)
        data = self._data
        low = min(data.site_xpos[sole, 2] for sole in self._soles)
        neck = data.site_xpos[self._model.site(self._robot.neck_site).id, 2]
        return float((neck - low) / self._robot.standing_neck_height)


def _share_weight(sideways: Array, center: float) -> Array:
    """Share the weight among soles by where they are sideways [m], (s,)."""
    if len(sideways) != 2 or abs(sideways[0] - sideways[1]) < 1e-6:
        return np.full(len(sideways), 1.0 / len(sideways))
    first = float(np.clip((center - sideways[1]) / (sideways[0] - sideways[1]), 0.0, 1.0))
    return np.array([first, 1.0 - first])
