"""Legs on a slope: fits the legs of a policy for level ground to a known slope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from humanoid_getup.policy.observation import Sensed
from humanoid_getup.scenes.ground import Slope
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from humanoid_getup.style.features import find_ahead
from robots import Robot, quaternion
from robots.kinematics import place_postures
from robots.quaternion import Array

HEADINGS = np.linspace(-np.pi, np.pi, 37)  # rad
BEGIN, FULL = 0.55, 0.8  # neck heights from which legs are shifted, and shifted as a whole
LEANING, UPRIGHT = 0.7, 0.85  # cosines of the torso's tilt, likewise
SPEED = 3.0  # rad/s


class SlopeLegs:
    """Shifts of the leg joints of N robots that rise on a known slope.

    An addition to [Frezzato22]: soles come flat on the slope under an upright body, and the policy
    observes joint angles without the shift, as if it were on level ground.
    """

    def __init__(self, robot: Robot, n: int, slope: float) -> None:
        """Fit the stance to a slope along +x [rad], in each heading."""
        self._robot = robot
        self.shift = np.zeros((n, robot.n))
        """Shifts of the joint angles [rad], (N, n)."""
        world = World(robot, Scene(name="slope", ground=Slope(angle=slope)))
        fit, stance, ones = GroundFit(world), robot.standing, np.ones((len(HEADINGS), 1))
        orientation = quaternion.multiply(quaternion.from_yaw(HEADINGS), stance.orientation)
        joint_pos = ones * stance.joint_pos
        stands = place_postures(robot, world.model, ones * stance.position, orientation, joint_pos)
        self._find = RegularGridInterpolator((HEADINGS,), [fit.shift_legs(qpos) for qpos in stands])

    def level(self, sensed: Sensed) -> Sensed:
        """Return measurements as on level ground."""
        return replace(sensed, joint_pos=sensed.joint_pos - self.shift)

    def place(self, target: Array) -> Array:
        """Return joint targets (N, n) for those on level ground, within the joints' ranges."""
        return np.clip(target + self.shift, self._robot.lower, self._robot.upper)

    def compute(self, orientation: Array, neck_height: Array) -> Array:
        """Compute the shifts (N, n) for orientations of the torso in the world, (N, 4).

        Neck heights are shares of standing, (N,).
        """
        upright = -quaternion.gravity_in_body(orientation)[:, 2]
        risen = np.clip((neck_height - BEGIN) / (FULL - BEGIN), 0.0, 1.0)
        risen = risen * np.clip((upright - LEANING) / (UPRIGHT - LEANING), 0.0, 1.0)
        return risen[:, np.newaxis] * self._find(find_heading(orientation)[:, np.newaxis])

    def send(
        self, target: Array, following: Array, wanted: Array, reach: Array, step_time: float
    ) -> tuple[Array, Array]:
        """Return the targets before and after a policy step [s] for those on level ground, (N, n).

        Shifts come nearer to those that are wanted, (N, n), and no target moves further than its
        reach [rad], (n,).
        """
        before, moved, most = self.place(target), following - target, SPEED * step_time
        least, largest = np.maximum(-most, -reach - moved), np.minimum(most, reach - moved)
        self.shift = self.shift + np.clip(wanted - self.shift, least, largest)
        return before, self.place(following)


def find_heading(orientation: Array) -> Array:
    """Find the heading [rad] of orientations, (..., 4)."""
    ahead = find_ahead(orientation)
    return np.arctan2(ahead[..., 1], ahead[..., 0])
