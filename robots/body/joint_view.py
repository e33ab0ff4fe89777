"""A model at given joint angles: its joints and the ends of its limbs, in the torso's frame."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.body.parts import gather_links
from robots.body.shapes import sample_shapes
from robots.kinematics import couple_passive_joints, rest_passive_joints
from robots.quaternion import Array
from robots.robot import Robot

SHARPNESS = 8  # power of the distance by which points count: those far away count alone
NO_WAY = 1e-6  # share of the largest distance below which points are around a joint on all sides


class LimbEnds:
    """Locates the ends of what the joints of a model move."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._points: dict[int, tuple[Array, NDArray[np.int_]]] = {}

    def locate(self, data: mujoco.MjData, joint: int) -> Array:
        """Locate the end of the bodies that a joint moves, in the world, (3,) [m].

        It is in the middle of what is farthest from the joint: at the joint itself if that is in
        their middle. Bodies without shapes end at their center of mass.
        """
        points, owners = self._sample(joint)
        if not len(points):
            return data.subtree_com[self._model.jnt_bodyid[joint]]
        axes = data.xmat[owners].reshape(-1, 3, 3)
        start = data.xanchor[joint]
        ways = data.xpos[owners] + np.einsum("pij,pj->pi", axes, points) - start  # (p, 3)
        distances = np.linalg.norm(ways, axis=1)
        weights = (distances / distances.max()) ** SHARPNESS
        middle = weights @ ways / weights.sum()
        length = float(np.linalg.norm(middle))
        if length < NO_WAY * distances.max():
            return start.copy()
        return start + middle / length * np.max(ways @ middle) / length

    def _sample(self, joint: int) -> tuple[Array, NDArray[np.int_]]:
        """Return points that span the bodies that a joint moves, (p, 3) [m], and their bodies."""
        if joint not in self._points:
            bodies = gather_links(self._model, int(self._model.jnt_bodyid[joint])).list_bodies()
            sampled = {body: sample_shapes(self._model, body) for body in bodies}
            owners = [np.full(len(points), body) for body, points in sampled.items()]
            self._points[joint] = np.concatenate([*sampled.values()]), np.concatenate(owners)
        return self._points[joint]


TWIST = 0.8  # cosine between an axis and a direction from which a joint only twists about it
SMALL = 1e-9


class JointView:
    """A floating model whose torso is at the origin, and n of its joints, each by its place."""

    def __init__(
        self, model: mujoco.MjModel, joints: Sequence[int], passive: Sequence[str] = ()
    ) -> None:
        """Look at joints by their ids; passive ones, by their names, follow them or rest."""
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
