"""Arms: can they reach the ground and push the torso off it?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from humanoid_getup.motions.limbs import Limb, Limbs
from humanoid_getup.robot_check.finding import Finding
from humanoid_getup.robot_check.statics import Statics
from robots import Robot

SHARE_ON_HANDS = 0.5  # of the weight, as a robot on hands and feet carries it at first
STRONG_ENOUGH = 0.8  # share of stall torque at which a push is still slow and sure
LEAST_REACH = 0.5  # share of the shoulders' height in a squat that arms should span


def check_arms(robot: Robot, lowest_neck: float) -> Iterator[Finding]:
    """Find what a robot's arms cannot do; the neck's lowest share of its height is a squat's."""
    limbs = Limbs(robot)
    arms = [limbs.all[name] for name in ("left_arm", "right_arm") if name in limbs.all]
    if not arms:
        yield Finding(
            level="warning",
            subject="arms",
            text="there are none that bend, so it has to get up by legs and trunk alone",
        )
        return
    yield _check_reach(robot, limbs, arms[0], lowest_neck)
    yield from _check_push(robot, limbs, arms[0])


def _measure_arm(limbs: Limbs, arm: Limb) -> tuple[float, float]:
    """Measure upper arm and forearm [m]."""
    limbs.measure(limbs.robot.standing.joint_pos)
    upper = limbs.anchor(arm.middle) - limbs.anchor(arm.start)
    lower = limbs.end(arm) - limbs.anchor(arm.middle)
    return float(np.linalg.norm(upper)), float(np.linalg.norm(lower))


def _check_reach(robot: Robot, limbs: Limbs, arm: Limb, lowest_neck: float) -> Finding:
    length, height = sum(_measure_arm(limbs, arm)), lowest_neck * robot.standing_neck_height
    share = length / height
    is_long = share >= LEAST_REACH
    return Finding(
        level="ok" if is_long else "warning",
        subject="arms",
        text=f"{length:.2f} m long, {share:.0%} of the neck's height in the deepest squat"
        + ("" if is_long else f", expected at least {LEAST_REACH:.0%}: hands may not help"),
    )


def _check_push(robot: Robot, limbs: Limbs, arm: Limb) -> Iterator[Finding]:
    """Compare what pushing the torso off the ground takes with what shoulder and elbow have.

    Prone, each hand lifts its share of the weight at the end of a straight arm; with the elbow
    bent by a right angle, at that of the upper arm, and the elbow carries it at the forearm's.
    """
    upper, lower = _measure_arm(limbs, arm)
    force = 0.5 * SHARE_ON_HANDS * Statics(robot).weight
    shoulder = arm.joints[0]
    elbow = arm.middle
    has = robot.max_torque
    straight, bent = force * (upper + lower), force * upper
    names = robot.joint_names
    if has[shoulder] * STRONG_ENOUGH >= straight:
        text = (
            f"push-ups with straight arms need {straight:.2f} N·m at '{names[shoulder]}', "
            f"{straight / has[shoulder]:.0%} of its stall torque"
        )
        yield Finding(level="ok", subject="arms", text=text)
        return
    weak = has[shoulder] * STRONG_ENOUGH < bent
    yield Finding(
        level="warning",
        subject=f"joint '{names[shoulder]}'",
        text=f"has {has[shoulder]:.2f} N·m; a push-up needs {straight:.2f} N·m with straight arms "
        f"and {bent:.2f} N·m with bent ones",
        remedy=f"a servo of {straight / STRONG_ENOUGH:.1f} N·m would push with straight arms"
        if weak
        else "it has to push with bent arms",
    )
    carried = force * lower
    if has[elbow] * STRONG_ENOUGH < carried:
        yield Finding(
            level="warning",
            subject=f"joint '{names[elbow]}'",
            text=f"has {has[elbow]:.2f} N·m; a push-up with bent arms needs {carried:.2f} N·m",
            remedy=f"a servo of {carried / STRONG_ENOUGH:.1f} N·m would do",
        )
