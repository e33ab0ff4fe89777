"""Limb solver: joint angles that bring arms and legs into given poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robots.body.limb import LEGS, Limb, LimbName, LimbPose
from robots.body.limbs import Limbs
from robots.quaternion import Array

BALANCE = 4.0  # weight of the mass center's place over the soles, in leg lengths
HABIT = 0.05  # weight of the way from the angles before, beside unit vectors [1/rad]
FOOT = 0.5  # weight of a foot's axes beside the directions of thigh and shank
EDGE = 1e-6  # share of a range at whose ends a search does not begin


@dataclass(frozen=True)
class LimbSolver:
    """Finds joint angles for the poses of limbs, within the joints' ranges."""

    limbs: Limbs

    def solve(
        self, poses: dict[LimbName, LimbPose], before: Array, *, is_near: bool = False
    ) -> Array:
        """Find the joint angles (n,) that bring the limbs nearest to poses.

        Joints that are in no limb, and those that no pose concerns, stay as before.

        Args:
            poses: Of the limbs to be moved; those that the robot lacks are left out.
            before: Angles from which the way should be short [rad], (n,).
            is_near: Whether to search only around those, as from one frame to the next.
        """
        angles = before.copy()
        for name, pose in poses.items():
            if name in self.limbs.all:
                angles = self._solve_limb(self.limbs.all[name], pose, angles, is_near=is_near)
        return angles

    def solve_balance(self, ahead: float, before: Array) -> Array:
        """Shift the mass over the soles by hips, knees and ankles; see `Limbs.measure_balance`."""
        limbs = self.limbs
        legs = [limbs.leg(name) for name in LEGS]
        limbs.look(limbs.robot.standing.joint_pos)
        joints = [k for leg in legs for k in leg.list_pitch()]
        limbs.look(before)
        feet = [leg.sole_axes for leg in legs]
        start = self._inside(joints, before[joints])

        def residuals(values: Array) -> Array:
            self._look(before, joints, values)
            turned = [leg.sole_axes - foot for leg, foot in zip(legs, feet, strict=True)]
            off = BALANCE * (limbs.over_soles()[0] - ahead)
            return np.concatenate([[off], *map(np.ravel, turned), HABIT * (values - start)])

        found = least_squares(residuals, start, bounds=self._bounds(joints)).x
        return _replaced(before, joints, found)

    def _solve_limb(self, limb: Limb, pose: LimbPose, before: Array, *, is_near: bool) -> Array:
        joints, robot = list(limb.joints), self.limbs.robot
        start = self._inside(joints, before[joints])

        def residuals(values: Array) -> Array:
            self._look(before, joints, values)
            found = self.limbs.read_pose(limb)
            errors = [found.upper - pose.upper, found.lower - pose.lower, HABIT * (values - start)]
            if pose.foot is not None and found.foot is not None:
                errors.append(FOOT * (found.foot - pose.foot).ravel())
            return np.concatenate(errors)

        bounds = self._bounds(joints)
        tries = [start]
        if not is_near:
            tries += [0.5 * (bounds[0] + bounds[1]), robot.standing.joint_pos[joints]]
        solved = [least_squares(residuals, self._inside(joints, t), bounds=bounds) for t in tries]
        return _replaced(before, joints, min(solved, key=lambda found: found.cost).x)

    def _look(self, before: Array, joints: list[int], values: Array) -> None:
        self.limbs.look(_replaced(before, joints, values))

    def _bounds(self, joints: list[int]) -> tuple[Array, Array]:
        robot = self.limbs.robot
        return robot.lower[joints], robot.upper[joints]

    def _inside(self, joints: list[int], values: Array) -> Array:
        """Move angles off the ends of their ranges, since a search cannot begin there."""
        lower, upper = self._bounds(joints)
        inner = EDGE * (upper - lower)
        return np.clip(values, lower + inner, upper - inner)


def _replaced(angles: Array, joints: list[int], values: Array) -> Array:
    out = angles.copy()
    out[joints] = values
    return out
