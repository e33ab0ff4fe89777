"""Arms: can they reach the ground and push the torso off it?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from humanoid_getup.robot_check.finding import Finding
from robots.body.limb import ARMS, Limb
from robots.body.limbs import Limbs

SHARE_ON_HANDS = 0.5  # of the weight, as a robot on hands and feet carries it at first
STRONG_ENOUGH = 0.8  # share of stall torque at which a push is still slow and sure
LEAST_REACH = 0.5  # share of the neck's height in a squat that arms should span


def check_arms(limbs: Limbs, weight: float, lowest_neck: float) -> Iterator[Finding]:
    """Find what a robot's arms cannot do.

    Args:
        limbs: Of the robot.
        weight: Of the robot [N].
        lowest_neck: Share of its height to which the neck comes down in a squat.
    """
    arms = [limbs.all[name] for name in ARMS if name in limbs.all]
    if not arms:
        yield Finding(
            level="warning",
            subject="arms",
            text="there are none that bend, so it has to get up by legs and trunk alone",
        )
        return
    yield _check_reach(limbs, arms, lowest_neck)
    force = SHARE_ON_HANDS * weight / len(arms)
    found = [finding for arm in arms for finding in _check_push(limbs, arm, force)]
    yield from found or [_describe_push(limbs, arms, force)]


def _measure_arm(limbs: Limbs, arm: Limb) -> tuple[float, float]:
    """Measure upper arm and forearm [m]."""
    limbs.look(limbs.robot.standing.joint_pos)
    upper = limbs.anchor(arm.middle) - limbs.anchor(arm.start)
    lower = limbs.find_end(arm) - limbs.anchor(arm.middle)
    return float(np.linalg.norm(upper)), float(np.linalg.norm(lower))


def _check_reach(limbs: Limbs, arms: list[Limb], lowest_neck: float) -> Finding:
    length = min(sum(_measure_arm(limbs, arm)) for arm in arms)
    share = length / (lowest_neck * limbs.robot.standing_neck_height)
    is_long = share >= LEAST_REACH
    return Finding(
        level="ok" if is_long else "warning",
        subject="arms",
        text=f"{length:.2f} m long, {share:.0%} of the neck's height in the deepest squat"
        + ("" if is_long else f", expected at least {LEAST_REACH:.0%}"),
        remedy="" if is_long else "its hands may not help: rise by legs and trunk",
    )


def _check_push(limbs: Limbs, arm: Limb, force: float) -> Iterator[Finding]:
    """Compare what pushing the torso off the ground takes with what shoulder and elbow have.

    Prone, each hand lifts its share of the weight at the end of a straight arm; with the elbow
    bent by a right angle, at that of the upper arm, and the elbow carries it at the forearm's.
    """
    robot, (upper, lower) = limbs.robot, _measure_arm(limbs, arm)
    shoulder, elbow, has = arm.joints[0], arm.middle, robot.max_torque
    straight, bent, carried = force * (upper + lower), force * upper, force * lower
    if has[shoulder] * STRONG_ENOUGH >= straight:
        return
    weak = has[shoulder] * STRONG_ENOUGH < bent
    yield Finding(
        level="warning",
        subject=f"joint '{robot.joint_names[shoulder]}'",
        text=f"has {has[shoulder]:.2f} N·m; a push-up needs {straight:.2f} N·m with straight arms "
        f"and {bent:.2f} N·m with bent ones",
        remedy=f"a servo of {straight / STRONG_ENOUGH:.1f} N·m would push with straight arms"
        if weak
        else "it has to push with bent arms",
    )
    if has[elbow] * STRONG_ENOUGH < carried:
        yield Finding(
            level="warning",
            subject=f"joint '{robot.joint_names[elbow]}'",
            text=f"has {has[elbow]:.2f} N·m; a push-up with bent arms needs {carried:.2f} N·m",
            remedy=f"a servo of {carried / STRONG_ENOUGH:.1f} N·m would do",
        )


def _describe_push(limbs: Limbs, arms: list[Limb], force: float) -> Finding:
    robot = limbs.robot
    needs = {arm.joints[0]: force * sum(_measure_arm(limbs, arm)) for arm in arms}
    worst = max(needs, key=lambda k: needs[k] / robot.max_torque[k])
    share = needs[worst] / robot.max_torque[worst]
    return Finding(
        level="ok",
        subject="arms",
        text=f"push-ups with straight arms need {needs[worst]:.2f} N·m at "
        f"'{robot.joint_names[worst]}', {share:.0%} of its stall torque",
    )
