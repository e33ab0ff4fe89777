"""Figures of a run that follow from joints and servos alone, without an orientation."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from drivers import State
from humanoid_getup.experiments.judging.judge import record_joints
from humanoid_getup.experiments.judging.outcome import Outcome
from robots import Robot


class JointFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of a run, as reports name them; torques are estimated from currents."""

    peak_torque_nm: float
    """Greatest torque with which a servo drove its joint [N·m]."""
    peak_braking_torque_nm: float
    """Greatest torque with which a servo was turned from outside [N·m]."""
    rms_torque_nm: float
    """RMS over all joints and the whole run [N·m]."""
    torque_use: float
    """Largest driving torque of any servo as a share of its limit."""
    peak_velocity_rad_s: float
    """[rad/s]"""
    limit_violations: int
    """Number of times a joint left its range."""

    @staticmethod
    def of(robot: Robot, torque_limit: float | None, states: Sequence[State]) -> JointFigures:
        """Measure a run, one state a control period, under a torque limit [N·m]."""
        record = record_joints(robot, states, robot.control_period)
        outcome = Outcome(record, robot, torque_limit=torque_limit)
        return outcome.figures(JointFigures)

    def __str__(self) -> str:
        """Describe the load of the servos in one line."""
        return (
            f"peak about {self.peak_torque_nm:.2f} N·m ({self.torque_use:.0%} of the limit), RMS "
            f"{self.rms_torque_nm:.2f} N·m, peak {self.peak_velocity_rad_s:.1f} rad/s"
        )
