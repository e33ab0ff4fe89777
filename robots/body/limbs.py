"""Limbs: where the arms and legs of any robot point at given joint angles."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from robots.body.joint_view import SMALL, JointView
from robots.body.leg import Leg
from robots.body.limb import LEGS, Limb, LimbName, LimbPose
from robots.body.limb_finder import find_limbs
from robots.quaternion import Array
from robots.robot import Robot

PARALLEL = np.cos(np.radians(30.0))
OVER_SOLES = 0.35  # leg lengths by which the mass may be beside the soles of a crouching robot


class Limbs(JointView):
    """Arms and legs of a robot, found from its joints and soles.

    Positions and directions are in the torso's frame.
    """

    def __init__(self, robot: Robot) -> None:
        """Find the limbs.

        Raises:
            ValueError: if it does not have two legs of at least two joints.
        """
        view = JointView.of(robot)
        super().__init__(view.model, view.ids, robot.passive_joints)
        self.robot = robot
        self.look(robot.standing.joint_pos)
        self.all: dict[LimbName, Limb] = find_limbs(robot, self)
        """Limbs by name; a robot may lack arms."""
        self.thigh_and_shank = self._measure_leg()
        """Of thigh and shank [m]."""

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
        lower = _unit(self.find_end(limb) - middle)
        is_arm = limb.sole is None
        return LimbPose(upper, lower, None if is_arm else self.leg(limb.name).sole_axes)

    def first_body(self, limb: Limb) -> int:
        """Return the body that a limb's first joint moves."""
        return int(self.model.jnt_bodyid[self.ids[limb.joints[0]]])

    def find_end(self, limb: Limb) -> Array:
        """Find where a limb's lower part ends, at the angles looked at last, (3,) [m]."""
        return self.end(limb.middle) if limb.end is None else self.anchor(limb.end)

    def measure_parts(self, limb: Limb) -> tuple[float, float]:
        """Measure the upper and the lower part of a limb in the stance [m]."""
        self.look(self.robot.standing.joint_pos)
        upper = self.anchor(limb.middle) - self.anchor(limb.start)
        lower = self.find_end(limb) - self.anchor(limb.middle)
        return float(np.linalg.norm(upper)), float(np.linalg.norm(lower))

    def leg(self, name: LimbName) -> Leg:
        """Return a leg, to be measured at the angles looked at last."""
        limb = self.all[name]
        assert limb.sole is not None
        return Leg(self, limb.joints, limb.sole)

    @property
    def mass(self) -> float:
        """Return the mass of the robot [kg]."""
        return float(self.model.body_subtreemass[self.torso])

    def measure_balance(self, joint_pos: Array) -> float | None:
        """Measure how far the center of mass is in front of the soles, in leg lengths.

        None where the robot would not stand on them: where they are not parallel, or the mass is
        not above them.
        """
        self.look(joint_pos)
        left, right = (self.leg(name).sole_axes for name in LEGS)
        if left[:, 2] @ right[:, 2] < PARALLEL:
            return None
        ahead, above = self.over_soles()
        return ahead if above > 0.0 and abs(ahead) < OVER_SOLES else None

    def over_soles(self) -> tuple[float, float]:
        """Return the center of mass in front of and above the soles, in leg lengths."""
        legs = [self.leg(name) for name in LEGS]
        middle = np.mean([leg.sole_position for leg in legs], axis=0)
        axes = np.mean([leg.sole_axes for leg in legs], axis=0)
        way = (self.center_of_mass - middle) / self.thigh_and_shank
        return float(way @ axes[:, 0]), float(way @ axes[:, 2])

    def _measure_leg(self) -> float:
        leg = self.all["left_leg"]
        ends = [leg.start, leg.middle] + ([] if leg.end is None else [leg.end])
        points = np.array([self.anchor(k) for k in ends])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _unit(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), SMALL)
