"""Strength: can the servos hold the stance, and squats that are deep enough to rise from?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from humanoid_getup.robot_check.finding import Finding
from robots import Robot
from robots.body.squats import DEEP_ENOUGH, Squat
from robots.quaternion import Array

STRONG_ENOUGH = 0.5  # share of stall torque that leaves a servo as much to move with


def check_strength(robot: Robot, stance: Array, squats: Sequence[Squat]) -> Iterator[Finding]:
    """Compare torques with those of the servos at the robot's supply, a finding a joint.

    Args:
        robot: Robot.
        stance: Torques that hold the stance [N·m], (n,).
        squats: Those in which it was looked at.
    """
    has = robot.max_torque * robot.supply_voltage / robot.nominal_voltage
    stance = np.abs(stance)
    need = np.max([stance, *(np.abs(squat.torque) for squat in squats)], axis=0)
    must = [np.abs(squat.torque) for squat in squats if squat.neck_share >= DEEP_ENOUGH]
    least = np.max([stance, *must], axis=0)
    weak = [k for k in np.argsort(-need / has) if need[k] > STRONG_ENOUGH * has[k]]
    for k in weak:
        is_in_stance = stance[k] > STRONG_ENOUGH * has[k]
        torque = stance[k] if is_in_stance else need[k]
        yield Finding(
            level="fault" if least[k] > has[k] else "warning",
            subject=f"joint '{robot.joint_names[k]}'",
            text=f"needs {torque:.2f} N·m to hold {'the stance' if is_in_stance else 'a squat'}, "
            f"{torque / has[k]:.0%} of the {robot.joints[k].servo.model.name}'s {has[k]:.2f} N·m "
            f"at {robot.supply_voltage:g} V, expected at most {STRONG_ENOUGH:.0%}",
            remedy=f"a servo of {torque / STRONG_ENOUGH:.1f} N·m would do"
            + ("; or straighten the knees in [standing]" if is_in_stance else "")
            + ("; or avoid deep squats" if least[k] <= has[k] and not is_in_stance else ""),
        )
    if not weak:
        worst = int(np.argmax(need / has))
        yield Finding(
            level="ok",
            subject="squat",
            text=f"the most strained joint is '{robot.joint_names[worst]}' with {need[worst]:.2f} "
            f"N·m, {need[worst] / has[worst]:.0%} of its stall torque",
        )
