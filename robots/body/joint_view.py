"""A model at given joint angles: positions and axes of its joints, in the torso's frame."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from robots.body.ends import LimbEnds
from robots.passive_joints import couple_passive_joints, rest_passive_joints
from robots.quaternion import Array
from robots.robot import Robot

TWIST = 0.8  # cosine between an axis and a direction from which a joint only twists about it
SMALL = 1e-9


class JointView:
    """A floating model whose torso is at the origin, and n of its joints, each by its place."""

    def __init__(
        self, model: mujoco.MjModel, joints: Sequence[int], passive: Sequence[str] = ()
    ) -> None:
        """Prepare to look at a model.

        Args:
            model: With one free joint, that of the torso.
            joints: The joints that have angles, by their ids.
            passive: Names of those that follow them or rest.
        """
        self.model, self.data = model, mujoco.MjData(model)
        self.ids, self._passive = list(joints), tuple(passive)
        self._addresses = model.jnt_qposadr[self.ids]
        self._ends = LimbEnds(model)
        root = int(np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
        self.torso = int(model.jnt_bodyid[root])
        """Body of the torso."""
        at = int(model.jnt_qposadr[root])
        self._rest = model.qpos0.copy()
        self._rest[at : at + 7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        rest_passive_joints(model, self._passive, self._rest)

    @classmethod
    def of(cls, robot: Robot) -> JointView:
        """View the joints of a robot, in its order."""
        model = robot.spec().compile()
        ids = [model.joint(name).id for name in robot.joint_names]
        return cls(model, ids, robot.passive_joints)

    def look(self, angles: Array) -> None:
        """Bring `data` to joint angles (n,) [rad]; passive joints follow."""
        data = self.data
        data.qpos[:] = self._rest
        data.qpos[self._addresses] = angles
        couple_passive_joints(self.model, self._passive, data.qpos)
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)

    def anchor(self, joint: int) -> Array:
        """Return a point on a joint's axis, at the angles looked at last, (3,) [m]."""
        return self.data.xanchor[self.ids[joint]]

    def axis(self, joint: int) -> Array:
        """Return the axis of a joint, at the angles looked at last, (3,)."""
        return self.data.xaxis[self.ids[joint]]

    def end(self, joint: int) -> Array:
        """Return the end of the bodies that a joint moves, at the last angles, (3,) [m]."""
        return self._ends.locate(self.data, self.ids[joint])

    def twists(self, joint: int, way: Array) -> bool:
        """Tell whether a joint only turns what lies along a vector (3,) about itself."""
        along = abs(self.axis(joint) @ way)
        return bool(along > TWIST * max(float(np.linalg.norm(way)), SMALL))

    def list_pitch(self, joints: Sequence[int]) -> list[int]:
        """List the joints that turn about the y axis, at the angles looked at last."""
        return [k for k in joints if abs(self.axis(k)[1]) > TWIST]

    @property
    def center_of_mass(self) -> Array:
        """Return the body's center of mass, at the angles looked at last, (3,) [m]."""
        return self.data.subtree_com[self.torso]
