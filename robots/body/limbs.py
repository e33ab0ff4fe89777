"""Limbs: where the arms and legs of any robot point at given joint angles."""

from __future__ import annotations

from functools import cached_property

import mujoco
import numpy as np

from robots import Robot
from robots.body.ends import locate_end
from robots.body.limb import LEGS, Limb, LimbName, LimbPose
from robots.body.limb_finder import find_limbs
from robots.passive_joints import couple_passive_joints, rest_passive_joints
from robots.quaternion import Array

SMALL = 1e-9
PARALLEL = np.cos(np.radians(30.0))
OVER_SOLES = 0.35  # leg lengths by which the mass may be beside the soles of a crouching robot


class Limbs:
    """Arms and legs of a robot, found from its joints and soles.

    Positions and directions are in the torso's frame.
    """

    def __init__(self, robot: Robot) -> None:
        """Find the limbs.

        Raises:
            ValueError: if it does not have two legs of at least two joints.
        """
        self.robot, self.model = robot, robot.spec().compile()
        self.data = mujoco.MjData(self.model)
        self._layout = robot.layout(self.model)
        self._ids = [self.model.joint(name).id for name in robot.joint_names]
        self._rest = self.model.qpos0.copy()
        self._rest[self._layout.root_position] = 0.0
        self._rest[self._layout.root_orientation] = [1.0, 0.0, 0.0, 0.0]
        rest_passive_joints(self.model, robot.passive_joints, self._rest)
        self.look(robot.standing.joint_pos)
        self.all: dict[LimbName, Limb] = find_limbs(robot, self.model, self.data)
        """Limbs by name; a robot may lack arms."""
        self.leg_length = self._measure_leg()
        """Of thigh and shank [m]."""

    def look(self, joint_pos: Array) -> None:
        """Bring `data` to joint angles (n,), the torso at the origin; passive joints follow."""
        data = self.data
        data.qpos[:] = self._rest
        data.qpos[self._layout.qpos] = joint_pos
        couple_passive_joints(self.model, self.robot.passive_joints, data.qpos)
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)

    @cached_property
    def rest(self) -> dict[LimbName, LimbPose]:
        """Return the poses of the limbs in the robot's stance."""
        return self.measure(self.robot.standing.joint_pos)

    def measure(self, joint_pos: Array) -> dict[LimbName, LimbPose]:
        """Measure where the limbs point at joint angles (n,)."""
        self.look(joint_pos)
        return {name: self.read_pose(limb) for name, limb in self.all.items()}

    def read_pose(self, limb: Limb) -> LimbPose:
        """Return where a limb points, at the angles looked at last."""
        middle = self.anchor(limb.middle)
        upper = _unit(middle - self.anchor(limb.start))
        lower = _unit(self.end(limb) - middle)
        return LimbPose(upper, lower, None if limb.sole is None else self.sole_axes(limb))

    def first_body(self, limb: Limb) -> int:
        """Return the body that a limb's first joint moves."""
        return int(self.model.jnt_bodyid[self._ids[limb.joints[0]]])

    def anchor(self, joint: int) -> Array:
        """Return a point on a joint's axis, at the angles looked at last, (3,) [m]."""
        return self.data.xanchor[self._ids[joint]]

    def axis(self, joint: int) -> Array:
        """Return the axis of a joint, at the angles looked at last, (3,)."""
        return self.data.xaxis[self._ids[joint]]

    def end(self, limb: Limb) -> Array:
        """Return where a limb's lower part ends, at the angles looked at last, (3,) [m]."""
        if limb.end is not None:
            return self.anchor(limb.end)
        return locate_end(self.data, self._ids[limb.middle])

    def sole_position(self, leg: Limb) -> Array:
        """Return the position of a leg's sole, at the angles looked at last, (3,) [m]."""
        assert leg.sole is not None
        return self.data.site_xpos[leg.sole].copy()

    def sole_axes(self, leg: Limb) -> Array:
        """Return forward, left and up of a leg's sole in columns, (3, 3), likewise."""
        assert leg.sole is not None
        return self.data.site_xmat[leg.sole].reshape(3, 3).copy()

    @property
    def mass(self) -> float:
        """Return the mass of the robot [kg]."""
        return float(self.model.body_subtreemass[self._layout.torso])

    @property
    def center_of_mass(self) -> Array:
        """Return the robot's center of mass, at the angles looked at last, (3,) [m]."""
        return self.data.subtree_com[self._layout.torso]

    def measure_balance(self, joint_pos: Array) -> float | None:
        """Measure how far the center of mass is in front of the soles, in leg lengths.

        None where the robot would not stand on them: where they are not parallel, or the mass is
        not above them.
        """
        self.look(joint_pos)
        left, right = (self.sole_axes(self.all[name]) for name in LEGS)
        if left[:, 2] @ right[:, 2] < PARALLEL:
            return None
        ahead, above = self.over_soles()
        return ahead if above > 0.0 and abs(ahead) < OVER_SOLES else None

    def over_soles(self) -> tuple[float, float]:
        """Return how far the mass is in front of the soles and above them, in leg lengths."""
        legs = [self.all[name] for name in LEGS]
        middle = np.mean([self.sole_position(leg) for leg in legs], axis=0)
        axes = np.mean([self.sole_axes(leg) for leg in legs], axis=0)
        way = (self.center_of_mass - middle) / self.leg_length
        return float(way @ axes[:, 0]), float(way @ axes[:, 2])

    def _measure_leg(self) -> float:
        leg = self.all["left_leg"]
        ends = [leg.start, leg.middle] + ([] if leg.end is None else [leg.end])
        points = np.array([self.anchor(k) for k in ends])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _unit(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), SMALL)
