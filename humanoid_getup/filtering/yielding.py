"""Yielding: servos that press in vain are sent targets near the angles of their joints."""

from __future__ import annotations

import numpy as np

from humanoid_getup.experiments.judging.torque import LONG_SATURATION, SATURATED, limit_torque
from robots import Robot, TorqueLimit
from robots.quaternion import Array

YIELDS_AFTER = 0.6 * LONG_SATURATION  # s; with some time left for other worlds
PRESSING = 0.85  # share of its torque with which a servo that yields still presses


class Yielding:
    """Softens the targets of servos that have pressed with all their torque for too long.

    A limb that is caught under the body would otherwise press until the overload protection of its
    servos trips. A servo that yields presses with less, until its target is within its reach again.
    """

    def __init__(self, robot: Robot, limit: TorqueLimit, count: int) -> None:
        """Prepare for some robots under a torque limit; below their stall torque servos do not
        saturate."""
        saturates = limit_torque(robot, limit.value) >= SATURATED * robot.max_torque
        self._robot = robot
        self._trips = robot.trips & saturates & (robot.strength > 0.0)
        self._after = round(YIELDS_AFTER / robot.control_period)
        self._pressed = np.zeros((count, robot.n), dtype=int)
        self._yields = np.zeros((count, robot.n), dtype=bool)

    def soften(self, target: Array, sent: Array, joint_pos: Array) -> Array:
        """Soften targets (N, n) of the next period, after others were sent, at joint angles."""
        robot = self._robot
        presses = self._trips & (self._press(sent, joint_pos) >= SATURATED)
        self._pressed = np.where(presses, self._pressed + 1, 0)
        asked = self._press(target, joint_pos)
        began = self._pressed >= self._after
        self._yields = self._trips & (self._yields | began) & (asked > PRESSING)
        if not self._yields.any():
            return target
        share = np.where(self._yields, PRESSING / np.maximum(asked, PRESSING), 1.0)
        lead = robot.transmission.to_actuator(target - joint_pos)
        return joint_pos + robot.transmission.to_joint(share * lead)

    def _press(self, target: Array, joint_pos: Array) -> Array:
        """Compute the torques that targets ask of servos at rest, as shares of their own."""
        robot = self._robot
        lead = robot.transmission.to_actuator(target - joint_pos)
        return np.abs(robot.position_gain * lead) / robot.max_torque
