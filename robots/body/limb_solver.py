"""Joint angles that bring arms and legs into given poses, and turn the chest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # which imports its parts when they are used

from robots.body.joint_view import JointView
from robots.body.limbs import LEGS, Limb, LimbName, LimbPose, Limbs
from robots.body.parts import find_robot_parts
from robots.quaternion import Array
from robots.robot import Robot

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
            self.limbs.look(_replaced(before, joints, values))
            turned = [leg.sole_axes - foot for leg, foot in zip(legs, feet, strict=True)]
            off = BALANCE * (limbs.over_soles()[0] - ahead)
            return np.concatenate([[off], *map(np.ravel, turned), HABIT * (values - start)])

        found = scipy.optimize.least_squares(residuals, start, bounds=self._bounds(joints)).x
        return _replaced(before, joints, found)

    def _solve_limb(self, limb: Limb, pose: LimbPose, before: Array, *, is_near: bool) -> Array:
        joints, robot = list(limb.joints), self.limbs.robot
        start = self._inside(joints, before[joints])

        def residuals(values: Array) -> Array:
            self.limbs.look(_replaced(before, joints, values))
            found = self.limbs.read_pose(limb)
            errors = [found.upper - pose.upper, found.lower - pose.lower, HABIT * (values - start)]
            if pose.foot is not None and found.foot is not None:
                errors.append(FOOT * (found.foot - pose.foot).ravel())
            return np.concatenate(errors)

        bounds = self._bounds(joints)
        tries = [start]
        if not is_near:
            tries += [0.5 * (bounds[0] + bounds[1]), robot.standing.joint_pos[joints]]
        solved = [
            scipy.optimize.least_squares(residuals, self._inside(joints, t), bounds=bounds)
            for t in tries
        ]
        return _replaced(before, joints, min(solved, key=lambda found: found.cost).x)

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


TRUNK_HABIT = 0.1  # weight of an angle itself, beside the chest's axes [1/rad]: joints share a bend


class Trunk:
    """The joints on the way from the torso to the neck; none for a robot with a stiff trunk."""

    def __init__(self, robot: Robot) -> None:
        """Find the joints."""
        self._view = JointView.of(robot)
        self._chest = int(self._view.model.site(robot.neck_site).bodyid[0])
        spine = find_robot_parts(robot, self._view.model).find_spine(self._chest)
        above = {joint for link in spine for joint in link.joints}
        self.joints = [k for k, joint in enumerate(self._view.ids) if joint in above]
        """Places in the robot's order."""
        self._bounds = (robot.lower[self.joints], robot.upper[self.joints])
        self._rest = self.measure(robot.standing.joint_pos)

    @property
    def is_stiff(self) -> bool:
        """Return whether chest and torso are one."""
        return not self.joints

    def measure(self, joint_pos: Array) -> Array:
        """Measure the axes of the body that carries the neck in the torso's frame, (3, 3)."""
        self._view.look(joint_pos)
        return self._view.data.xmat[self._chest].reshape(3, 3).copy()

    def solve(self, chest: Array, before: Array) -> Array:
        """Find the joint angles (n,) that turn the chest nearest to axes (3, 3).

        The axes are in the torso's frame; at rest they are those of the torso.
        """
        wanted, angles = chest @ self._rest, before.copy()
        lower, upper = self._bounds

        def residuals(values: Array) -> Array:
            angles[self.joints] = values
            return np.concatenate([(self.measure(angles) - wanted).ravel(), TRUNK_HABIT * values])

        inner = 1e-6 * (upper - lower)
        start = np.clip(before[self.joints], lower + inner, upper - inner)
        angles[self.joints] = scipy.optimize.least_squares(residuals, start, bounds=self._bounds).x
        return angles
