"""Statics: the torques that hold a robot in a posture on its soles, without moving."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from robots import quaternion
from robots.kinematics import couple_passive_joints, place_postures
from robots.posture import Posture
from robots.quaternion import Array
from robots.robot import Robot

Hands = Sequence[tuple[int, Array]]
"""Bodies, and where in their frames they touch the ground [m], (3,) each."""
STEP = 1e-4  # rad, of the difference that tells by how much a passive joint follows another


class Statics:
    """Computes torques of postures in which both soles carry the weight."""

    def __init__(self, robot: Robot, footing: Array = quaternion.IDENTITY) -> None:
        """Prepare for soles with an orientation in the world, such as that of a slope (4,)."""
        self._robot, self._model = robot, robot.spec().compile()
        self._footing = footing
        self.up = quaternion.rotate(quaternion.inverse(footing), np.array([0.0, 0.0, 1.0]))
        """The world's vertical in the frame of the soles, (3,)."""
        self._model.opt.gravity[:] = float(self._model.opt.gravity[2]) * self.up
        self._data = mujoco.MjData(self._model)
        self._layout = robot.layout(self._model)
        self._soles = [self._model.site(name).id for name in robot.sole_sites]
        passive = [self._model.joint(name).id for name in robot.passive_joints]
        self._passive_qpos = self._model.jnt_qposadr[passive]
        self._passive_dof = self._model.jnt_dofadr[passive]

    @property
    def mass(self) -> float:
        """Return the mass of the robot [kg]."""
        return float(self._model.body_subtreemass[self._layout.torso])

    @property
    def weight(self) -> float:
        """Return the weight of the robot [N]."""
        return -float(self._model.opt.gravity @ self.up) * self.mass

    def place_on_soles(self, joint_pos: Array) -> None:
        """Pose the robot at joint angles (n,), its soles level on average."""
        data = self._data
        at = np.zeros(3), quaternion.IDENTITY
        data.qpos[:] = place_postures(self._robot, self._model, *at, joint_pos)
        data.qvel[:] = 0.0
        mujoco.mj_kinematics(self._model, data)
        u, _, v = np.linalg.svd(data.site_xmat[self._soles].reshape(-1, 3, 3).mean(axis=0))
        data.qpos[self._layout.root_orientation] = quaternion.from_matrix((u @ v).T)
        mujoco.mj_fwdPosition(self._model, data)
        mujoco.mj_fwdVelocity(self._model, data)

    def measure_torques(self, joint_pos: Array) -> Array:
        """Compute the torques of actuators that hold joint angles on both soles [N·m], (n,).

        The weight acts on each sole in shares that keep the lateral balance, straight below the
        center of mass.
        """
        return self._robot.transmission.torque_for_joint(self._measure_at_joints(joint_pos))

    def find_targets(self, joint_pos: Array, hands: Hands = (), share: float = 0.0) -> Array:
        """Find the targets that hold joint angles on both soles, within their limits, (n,) [rad].

        They lead the angles by the errors at which the servos make the torques. Hands carry a share
        of the weight together.
        """
        lead = self._robot.compute_lead(self._measure_at_joints(joint_pos, hands, share))
        return np.clip(joint_pos + lead, self._robot.lower, self._robot.upper)

    def _measure_at_joints(self, joint_pos: Array, hands: Hands = (), share: float = 0.0) -> Array:
        """Compute the torques at the joints that hold their angles on the ground [N·m], (n,)."""
        self.place_on_soles(joint_pos)
        data, model = self._data, self._model
        center = data.subtree_com[self._layout.torso]
        places = np.array([data.site_xpos[sole] for sole in self._soles])
        center = center - (center[2] - places[0, 2]) / self.up[2] * self.up
        shares = _share_weight(places[:, 1], float(center[1]))
        torque = data.qfrc_bias - data.qfrc_passive
        held = list[tuple[int, Array, float]]()
        for sole, place, own in zip(self._soles, places, shares, strict=True):
            ahead = place[0] if hands else center[0]
            point = np.array([ahead, place[1], place[2]])
            held.append((int(model.site_bodyid[sole]), point, (1.0 - share) * own))
        for body, place in hands:
            point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
            held.append((body, point, share / len(hands)))
        jacobian = np.zeros((3, model.nv))
        for body, point, own in held:
            mujoco.mj_jac(model, data, jacobian, None, point, body)
            torque -= jacobian.T @ (own * self.weight * self.up)
        return torque[self._layout.dof] + self._hand_on(torque[self._passive_dof])

    def _hand_on(self, torque: Array) -> Array:
        """Add the torques of passive joints (p,) to the joints that they follow, (n,) [N·m]."""
        out = np.zeros(self._robot.n)
        if not len(torque):
            return out
        at = np.tile(self._data.qpos, (self._robot.n, 1))
        at[np.arange(self._robot.n), self._layout.qpos] += STEP
        couple_passive_joints(self._model, self._robot.passive_joints, at)
        ratio = (at - self._data.qpos)[:, self._passive_qpos] / STEP  # (n, p)
        return ratio @ torque

    def make_posture(self, joint_pos: Array) -> Posture:
        """Return the posture at joint angles (n,) on the ground through 0, its soles flat on it."""
        self.place_on_soles(joint_pos)
        own = self._data.qpos[self._layout.root_orientation]
        return Posture(
            position=quaternion.rotate(self._footing, np.array([0.0, 0.0, -self._lowest_sole()])),
            orientation=quaternion.multiply(self._footing, own),
            joint_pos=joint_pos,
        )

    def measure_lean(self, joint_pos: Array) -> float:
        """Measure the angle between the torso's z axis and the vertical [rad]."""
        self.place_on_soles(joint_pos)
        upright = self._data.xmat[self._layout.torso].reshape(3, 3)[:, 2] @ self.up
        return float(np.arccos(np.clip(upright, -1.0, 1.0)))

    def measure_neck(self, joint_pos: Array) -> float:
        """Measure the height of the neck over the soles, as a share of that in the stance."""
        self.place_on_soles(joint_pos)
        neck = self._data.site_xpos[self._model.site(self._robot.neck_site).id, 2]
        over = (neck - self._lowest_sole()) / self.up[2]
        return float(over / self._robot.standing_neck_height)

    def _lowest_sole(self) -> float:
        return float(min(self._data.site_xpos[sole, 2] for sole in self._soles))


def _share_weight(sideways: Array, center: float) -> Array:
    """Divide the weight among soles by their sideways positions [m], (s,)."""
    if len(sideways) != 2 or abs(sideways[0] - sideways[1]) < 1e-6:
        return np.full(len(sideways), 1.0 / len(sideways))
    first = float(np.clip((center - sideways[1]) / (sideways[0] - sideways[1]), 0.0, 1.0))
    return np.array([first, 1.0 - first])
