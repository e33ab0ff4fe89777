"""Squats: how deep can a robot crouch on flat soles in balance?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from humanoid_getup.robot_check.finding import Finding
from robots.body.limb import LEGS
from robots.body.limbs import Limbs
from robots.body.squats import DEEP_ENOUGH, Squat

AT_END = np.radians(3.0)  # from the end of a range at which a joint stops a squat


def check_depth(limbs: Limbs, squats: Sequence[Squat]) -> Finding:
    """Find whether a robot can crouch deep enough, and which ranges stop it."""
    if not squats:
        return Finding(
            level="warning",
            subject="squat",
            text="no balanced posture on flat soles was found, so its strength is not known",
            remedy="check the sole sites, and the ranges of hips, knees and ankles",
        )
    deepest = min(squats, key=lambda squat: squat.neck_share)
    is_deep = deepest.neck_share <= DEEP_ENOUGH
    return Finding(
        level="ok" if is_deep else "warning",
        subject="squat",
        text=f"crouches in balance down to {deepest.neck_share:.0%} of its neck height"
        + ("" if is_deep else f", expected at most {DEEP_ENOUGH:.0%}")
        + _name_stops(limbs, deepest),
        remedy="" if is_deep else "widen the ranges that stop it, if the robot can",
    )


def _name_stops(limbs: Limbs, squat: Squat) -> str:
    robot = limbs.robot
    near = np.minimum(squat.joint_pos - robot.lower, robot.upper - squat.joint_pos) < AT_END
    legs = {k for name in LEGS for k in limbs.all[name].joints}
    names = [robot.joint_names[k] for k in np.flatnonzero(near) if k in legs]
    return f"; at the end of their ranges: {', '.join(names)}" if names else ""
