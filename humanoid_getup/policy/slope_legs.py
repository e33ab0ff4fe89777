"""Slope legs: legs of a policy of level ground, fitted to a slope that is known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from humanoid_getup.policy.observation import Sensed
from humanoid_getup.scenes.ground import Slope
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import place_postures
from robots.quaternion import Array

HEADINGS = np.linspace(-np.pi, np.pi, 37)  # rad from uphill, of fits
BEGIN, FULL = 0.55, 0.8  # neck heights from which legs are shifted, and shifted as a whole
LEANING, UPRIGHT = 0.7, 0.85  # cosines of the torso's tilt, likewise
SPEED = 3.0  # rad/s
AHEAD, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


class SlopeLegs:
    """Shifts of the leg joints of N robots that rise on a known slope.

    An addition to [Frezzato22]: soles come flat on the slope under an upright body, and the policy
    gets joint angles without the shift, as if it were on level ground.
    """

    def __init__(self, robot: Robot, n: int, slopes: Iterable[float]) -> None:
        """Fit the stance to slopes [rad]; between them the shifts are interpolated."""
        self._robot = robot
        self.shift = np.zeros((n, robot.n))
        """Shifts of the joint angles [rad], (N, n)."""
        steep = sorted({abs(angle) for angle in slopes} - {0.0})
        level = np.zeros((len(HEADINGS), robot.n))
        fits = np.array([level, *(_fit_headings(robot, angle) for angle in steep)])
        self._find = RegularGridInterpolator(([0.0, *steep], HEADINGS), fits)
        self._steepest = steep[-1]

    def level(self, sensed: Sensed) -> Sensed:
        """Return measurements as on level ground."""
        return replace(sensed, joint_pos=sensed.joint_pos - self.shift)

    def place(self, target: Array) -> Array:
        """Return joint targets (N, n) for those on level ground, within the joints' ranges."""
        return np.clip(target + self.shift, self._robot.lower, self._robot.upper)

    def compute(self, normal: Array, orientation: Array, neck_height: Array) -> Array:
        """Compute the shifts (N, n) that suit robots on slopes.

        Upward normals of the ground are (N, 3), orientations of the torso (N, 4), and neck heights
        as shares of standing (N,).
        """
        ahead, up = quaternion.rotate(orientation, AHEAD), quaternion.rotate(orientation, UP)
        heading = np.arctan2(ahead[:, 1], ahead[:, 0]) - np.arctan2(-normal[:, 1], -normal[:, 0])
        steep = np.minimum(np.arccos(np.minimum(normal[:, 2], 1.0)), self._steepest)
        turned = np.angle(np.exp(1j * heading))
        risen = np.clip((neck_height - BEGIN) / (FULL - BEGIN), 0.0, 1.0)
        risen = risen * np.clip((up[:, 2] - LEANING) / (UPRIGHT - LEANING), 0.0, 1.0)
        return risen[:, np.newaxis] * self._find(np.stack([steep, turned], axis=1))

    def advance(self, wanted: Array, step_time: float) -> None:
        """Bring the shifts nearer to those that are wanted, (N, n), in a policy step [s]."""
        most = SPEED * step_time
        self.shift = self.shift + np.clip(wanted - self.shift, -most, most)


def _fit_headings(robot: Robot, angle: float) -> Array:
    """Fit the stance to a slope [rad] in each heading; return shifts, (headings, n)."""
    world = World(robot, Scene(name="slope", ground=Slope(angle=angle)))
    fit, stance, ones = GroundFit(world), robot.standing, np.ones((len(HEADINGS), 1))
    orientation = quaternion.multiply(quaternion.from_yaw(HEADINGS), stance.orientation)
    joint_pos = ones * stance.joint_pos
    stands = place_postures(robot, world.model, ones * stance.position, orientation, joint_pos)
    return np.array([fit.shift_legs(qpos) for qpos in stands])
