"""Where joints are by the registers of all their servos, and which cannot be told from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.dynamixel.diagnostics import Diagnostics, Finding, ServoFacts, Severity, name_of
from drivers.dynamixel.whole_turns import OUTSIDE_RANGE, WholeTurns
from robots import Joint, Robot
from robots.quaternion import Array


def locate(robot: Robot, diagnosed: Diagnostics) -> Diagnostics:
    """Add the angles of a robot's joints to a diagnosis, and joints that may be elsewhere."""
    register, known = np.zeros(robot.n, dtype=int), np.zeros(robot.n, dtype=bool)
    rows = [robot.joint_names.index(servo.joint.name) for servo in diagnosed.servos]
    register[rows] = [servo.registers["present_position"] for servo in diagnosed.servos]
    known[rows] = True
    angles = WholeTurns(robot).find_angles(register, known)
    servos, findings = list[ServoFacts](), list(diagnosed.findings)
    for servo, row in zip(diagnosed.servos, rows, strict=True):
        here = float(angles[row][0]) if row in angles else None
        servos.append(replace(servo, angle=here))
        findings += _check(robot.joints[row], angles[row]) if row in angles else []
    return Diagnostics(tuple(servos), tuple(findings))


def _check(joint: Joint, angles: Array) -> list[Finding]:
    """List what is wrong with the possible angles of a joint [rad], likeliest first, (k,)."""
    here = angles[0]
    if not joint.lower - OUTSIDE_RANGE <= here <= joint.upper + OUTSIDE_RANGE:
        text = f"is at {here:+.2f} rad, outside [{joint.lower:+.2f}, {joint.upper:+.2f}] rad"
        remedy = "move it back by hand, or calibrate it"
        return [Finding(Severity.WARNING, name_of(joint), text, remedy)]
    elsewhere = sorted({f"{a:+.2f}" for a in angles[1:] if abs(a - here) > OUTSIDE_RANGE})
    if not elsewhere:
        return []
    text = f"is taken to be at {here:+.2f} rad, may be at {' or '.join(elsewhere)}: turns apart"
    remedy = "if it is not there, turn it to its middle by hand and connect again"
    return [Finding(Severity.WARNING, name_of(joint), text, remedy)]
