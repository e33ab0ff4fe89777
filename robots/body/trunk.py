"""The trunk: the joints between torso and neck, and the angles that turn the chest."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from robots.body.joint_view import JointView
from robots.body.parts import find_robot_parts
from robots.quaternion import Array
from robots.robot import Robot

HABIT = 0.1  # weight of an angle itself, beside the chest's axes [1/rad]: joints share a bend


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
            return np.concatenate([(self.measure(angles) - wanted).ravel(), HABIT * values])

        inner = 1e-6 * (upper - lower)
        start = np.clip(before[self.joints], lower + inner, upper - inner)
        angles[self.joints] = least_squares(residuals, start, bounds=self._bounds).x
        return angles
