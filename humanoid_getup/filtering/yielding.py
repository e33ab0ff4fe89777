"""Yielding: servos that press for too long are sent targets near the angles of their joints."""

from __future__ import annotations

import numpy as np

from humanoid_getup.experiments.judging.torque import LONG_SATURATION, SATURATED, limit_torque
from robots import Robot, TorqueLimit
from robots.quaternion import Array

YIELDS_AFTER = 0.6 * LONG_SATURATION  # s; with some time left for other worlds
PRESSING = 0.85  # share of its torque with which a servo that yields still presses


class Yielding:
    """Eases the targets of servos that have pressed with all their torque for too long.

    A limb that is caught under the body would otherwise press until the overload protection of its
    servos trips. A servo that yields presses with less, until its target is within its reach again.
    """

    def __init__(self, robot: Robot, limit: TorqueLimit, count: int) -> None:
        """Prepare for some robots under a torque limit.

        A servo saturates at rest where neither its limit nor its own stall torque is below what the
        supply would allow.
        """
        limit, supply = limit.on(robot), robot.supply_voltage / robot.nominal_voltage
        self._stall = supply * robot.max_torque
        saturates = limit_torque(robot, limit.value) >= SATURATED * self._stall
        self._robot = robot
        self._trips = robot.trips & saturates & (robot.strength > 0.0)
        self._gain = robot.position_gain * (1.0 if limit.by == "current" else supply)
        self._after = round(YIELDS_AFTER / robot.control_period)
        self._pressed = np.zeros((count, robot.n), dtype=int)
        self._yields = np.zeros((count, robot.n), dtype=bool)

    def ease(self, target: Array, sent: Array, joint_pos: Array) -> Array:
        """Compute what to add to targets (N, n), after others were sent, at joint angles [rad].

        It is 0 for robots none of whose servos yields.
        """
        robot = self._robot
        presses = self._trips & (self._ask(sent, joint_pos) >= SATURATED)
        self._pressed = np.where(presses, self._pressed + 1, 0)
        asked = self._ask(target, joint_pos)
        began = self._pressed >= self._after
        self._yields = self._trips & (self._yields | began) & (asked > PRESSING)
        if not self._yields.any():
            return np.zeros_like(target)
        share = np.where(self._yields, PRESSING / np.maximum(asked, PRESSING), 1.0)
        lead = robot.transmission.to_actuator(target - joint_pos)
        return robot.transmission.to_joint((share - 1.0) * lead)

    def _ask(self, target: Array, joint_pos: Array) -> Array:
        """Compute the torques that targets ask of servos at rest, as shares of their own."""
        lead = self._robot.transmission.to_actuator(target - joint_pos)
        return np.abs(self._gain * lead) / self._stall
