"""The check of a robot: description, abilities (squats, strength, push-ups) and motions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from humanoid_getup.motions.motion_database import (
    list_motions,
    load_database,
    name_robot,
    suggest_motions,
)
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.robot_check.model_check import (
    CheckFinding,
    check_body,
    check_mirrors,
    check_turns,
)
from humanoid_getup.robot_check.stance_check import check_hold, check_soles, check_stance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.limbs import ARMS, LEGS, Limb, Limbs
from robots.body.squats import DEEP_ENOUGH, Squat, find_touching, list_squats
from robots.body.statics import Statics
from robots.quaternion import Array

ABILITIES = ("squats", "strength", "arms", "holding the stance")


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotCheck:
    """Findings of a robot check."""

    robot: Robot
    findings: tuple[CheckFinding, ...]
    squats: tuple[Squat, ...]
    """Balanced squats from high to deep."""
    unchecked: tuple[str, ...] = ()
    """Parts that are not checked until the faults are corrected."""

    @property
    def is_sound(self) -> bool:
        """Return whether there is no fault."""
        return not _has_fault(self.findings)

    def describe(self) -> dict[str, Any]:
        """Describe the findings for JSON."""
        name = self.robot.name
        return {"robot": name, "findings": self.findings, "unchecked": self.unchecked}


def check_robot(robot: Robot, report: Callable[[str], None] = lambda _: None) -> RobotCheck:
    """Check body, stance, mirror pairs, strength and arms of a robot whose description loads.

    Each part of the check is reported as it begins.
    """
    report("its description")
    world, limbs, statics = World(robot), Limbs(robot), Statics(robot)
    findings = [*_check_description(world, limbs)]
    squats, unchecked = [], ABILITIES
    if not _has_fault(findings):
        report("its strength")
        squats = list_squats(limbs, statics)
        findings += _check_ability(limbs, statics, squats)
        unchecked = ABILITIES[-1:]  # a robot whose joints are too weak is sure to sink
    if not _has_fault(findings):
        report("its stance")
        findings += check_hold(world)
        unchecked = ()
    report("its motions")
    findings += [_check_motions(robot), _check_policies(robot)]
    return RobotCheck(
        robot=robot, findings=tuple(findings), squats=tuple(squats), unchecked=unchecked
    )


def _has_fault(findings: Iterable[CheckFinding]) -> bool:
    return any(finding.level == "fault" for finding in findings)


def _check_description(world: World, limbs: Limbs) -> Iterator[CheckFinding]:
    yield from check_body(limbs)
    yield from check_turns(limbs)
    yield from check_soles(limbs.robot)
    yield from check_mirrors(limbs)
    yield from check_stance(world, limbs)


def _check_ability(limbs: Limbs, statics: Statics, squats: list[Squat]) -> Iterator[CheckFinding]:
    lowest = min((squat.neck_share for squat in squats), default=1.0)
    stance = statics.measure_torques(limbs.robot.standing.joint_pos)
    yield check_depth(limbs, squats)
    yield from check_strength(limbs.robot, stance, squats)
    yield from check_arms(limbs, statics.weight, lowest)


LYING = ("supine", "prone", "left", "right")


def _check_motions(robot: Robot) -> CheckFinding:
    remedy = suggest_motions(robot)
    if not list_motions(robot):
        return CheckFinding.warning("motions", "there are none, so no rise can be planned", remedy)
    try:
        rising = load_database(robot).rising
    except ValueError as error:
        return CheckFinding.fault("motions", str(error), "build or remove them")
    known = {motion.start_class for motion in rising}
    missing = [side for side in LYING if side not in known]
    sides = ", ".join(side for side in LYING if side in known)
    if missing:
        return CheckFinding.warning(
            "motions",
            f"{len(rising)} that rise, from {sides or 'no side'}; none from {', '.join(missing)}",
            remedy,
        )
    text = f"{len(rising)} that rise, mirrored ones included, from {sides}"
    return CheckFinding.ok("motions", text)


def _check_policies(robot: Robot) -> CheckFinding:
    names = [file.stem for file in list_policies(robot)]
    if names:
        return CheckFinding.ok("policies", ", ".join(names))
    return CheckFinding.ok(
        "policies",
        "there are none; rises are planned",
        f"getup train {name_robot(robot)} --recipe quick --out out/quick",
    )


AT_END = np.radians(3.0)  # from the end of a range at which a joint stops a squat
HOLDS = 0.5  # share of stall torque that leaves a servo as much to move with
SHARE_ON_HANDS = 0.5  # of the weight, as a robot on hands and feet carries it at first
PUSHES = 0.8  # share of stall torque at which a push is still slow and sure
LEAST_REACH = 0.5  # share of the neck's height in a squat that arms should span


def check_depth(limbs: Limbs, squats: Sequence[Squat]) -> CheckFinding:
    """Find whether a robot can crouch deep enough, and which joint ranges limit it."""
    if not squats:
        return CheckFinding.warning(
            "squat",
            "no balanced posture on flat soles was found, so its strength is not known",
            "check the sole sites, and the ranges of hips, knees and ankles",
        )
    deepest = min(squats, key=lambda squat: squat.neck_share)
    text = f"crouches in balance down to {deepest.neck_share:.0%} of its neck height"
    stops = _name_stops(limbs, deepest)
    if round(deepest.neck_share, 2) <= DEEP_ENOUGH:  # as it is written
        return CheckFinding.ok("squat", text + stops)
    text = f"{text}, expected at most {DEEP_ENOUGH:.0%}{stops}"
    if stops:
        remedy = "widen the ranges that stop it, if the robot can"
    elif touching := find_touching(limbs, Statics(limbs.robot), squats):
        pairs = [f"'{first}' and '{second}'" for first, second in touching]
        text += f"; deeper, shapes touch: {', '.join(pairs)}"
        remedy = (
            "for parts that pass each other, add <exclude body1=... body2=.../> to <contact> of "
            "the model; import with or without --meshes makes other shapes"
        )
    else:
        remedy = "no range and no shape stops it: its balance may"
    return CheckFinding.warning("squat", text, remedy)


def _name_stops(limbs: Limbs, squat: Squat) -> str:
    robot = limbs.robot
    near = np.minimum(squat.joint_pos - robot.lower, robot.upper - squat.joint_pos) < AT_END
    legs = {k for name in LEGS for k in limbs.all[name].joints}
    names = [robot.joint_names[k] for k in np.flatnonzero(near) if k in legs]
    return f"; at the end of their ranges: {', '.join(names)}" if names else ""


def check_strength(robot: Robot, stance: Array, squats: Sequence[Squat]) -> Iterator[CheckFinding]:
    """Compare torques with those of the servos at the robot's supply, a finding a joint.

    ``stance`` are the torques that hold the stance [N·m], (n,).
    """
    has = robot.find_stall(robot.supply_voltage)
    drives = robot.strength > 0.0
    stance = np.abs(stance)
    need = np.max([stance, *(np.abs(squat.torque) for squat in squats)], axis=0)
    must = [np.abs(squat.torque) for squat in squats if squat.neck_share >= DEEP_ENOUGH]
    least = np.max([stance, *must], axis=0)
    for k in np.flatnonzero(~drives):
        yield CheckFinding.warning(
            f"joint '{robot.joint_names[k]}'",
            f"is limp: it does not make the {need[k]:.2f} N·m that squat and stance need of it",
            "mend its servo, and take it out of limp_joints of robot.toml",
        )
    weak = [k for k in np.argsort(-need / has) if need[k] > HOLDS * has[k] and drives[k]]
    for k in weak:
        is_in_stance = stance[k] > HOLDS * has[k]
        torque = stance[k] if is_in_stance else need[k]
        yield CheckFinding(
            level="fault" if least[k] > has[k] else "warning",
            subject=f"joint '{robot.joint_names[k]}'",
            text=f"needs {torque:.2f} N·m to hold {'the stance' if is_in_stance else 'a squat'}, "
            f"{torque / has[k]:.0%} of the {robot.joints[k].servo.model.name}'s {has[k]:.2f} N·m "
            f"at {robot.supply_voltage:g} V, expected at most {HOLDS:.0%}",
            remedy=f"a servo of {torque / HOLDS:.1f} N·m would do"
            + ("; or straighten the knees in [standing]" if is_in_stance else "")
            + ("; or avoid deep squats" if least[k] <= has[k] and not is_in_stance else ""),
        )
    if not weak:
        worst = int(np.argmax(drives * need / has))
        yield CheckFinding.ok(
            "squat",
            f"the most strained joint is '{robot.joint_names[worst]}' with {need[worst]:.2f} "
            f"N·m, {need[worst] / has[worst]:.0%} of its stall torque",
        )


def check_arms(limbs: Limbs, weight: float, lowest_neck: float) -> Iterator[CheckFinding]:
    """Find limits of the arms of a robot of a weight [N].

    ``lowest_neck`` is the share of its height to which the neck comes down in a squat.
    """
    drives = limbs.robot.strength > 0.0
    bending = [limbs.all[name] for name in ARMS if name in limbs.all]
    arms = [arm for arm in bending if drives[list(arm.joints)].all()]
    if not arms:
        what = "all that bend have a limp joint" if bending else "there are none that bend"
        yield CheckFinding.warning(
            "arms", f"{what}, so it has to get up by legs and trunk alone", ""
        )
        return
    yield _check_reach(limbs, arms, lowest_neck)
    force = SHARE_ON_HANDS * weight / len(arms)
    found = [finding for arm in arms for finding in _check_push(limbs, arm, force)]
    yield from found or [_describe_push(limbs, arms, force)]


def _check_reach(limbs: Limbs, arms: list[Limb], lowest_neck: float) -> CheckFinding:
    length = min(sum(limbs.measure_parts(arm)) for arm in arms)
    share = length / (lowest_neck * limbs.robot.standing_neck_height)
    text = f"{length:.2f} m long, {share:.0%} of the neck's height in the deepest squat"
    if share >= LEAST_REACH:
        return CheckFinding.ok("arms", text)
    return CheckFinding.warning(
        "arms",
        f"{text}, expected at least {LEAST_REACH:.0%}",
        "its hands may not help: rise by legs and trunk",
    )


def _check_push(limbs: Limbs, arm: Limb, force: float) -> Iterator[CheckFinding]:
    """Compare the torques of a push-up with those of shoulder and elbow.

    Prone, each hand lifts its share of the weight at the end of a straight arm; with the elbow
    bent by a right angle, at that of the upper arm, and the elbow carries it at the forearm's.
    """
    robot, (upper, lower) = limbs.robot, limbs.measure_parts(arm)
    shoulder, elbow, has = arm.joints[0], arm.middle, robot.max_torque
    straight, bent, carried = force * (upper + lower), force * upper, force * lower
    if has[shoulder] * PUSHES >= straight:
        return
    weak = has[shoulder] * PUSHES < bent
    yield CheckFinding.warning(
        f"joint '{robot.joint_names[shoulder]}'",
        f"has {has[shoulder]:.2f} N·m; a push-up needs {straight:.2f} N·m with straight arms "
        f"and {bent:.2f} N·m with bent ones",
        f"a servo of {straight / PUSHES:.1f} N·m would push with straight arms"
        if weak
        else "it has to push with bent arms",
    )
    if has[elbow] * PUSHES < carried:
        yield CheckFinding.warning(
            f"joint '{robot.joint_names[elbow]}'",
            f"has {has[elbow]:.2f} N·m; a push-up with bent arms needs {carried:.2f} N·m",
            f"a servo of {carried / PUSHES:.1f} N·m would do",
        )


def _describe_push(limbs: Limbs, arms: list[Limb], force: float) -> CheckFinding:
    robot = limbs.robot
    needs = {arm.joints[0]: force * sum(limbs.measure_parts(arm)) for arm in arms}
    worst = max(needs, key=lambda k: needs[k] / robot.max_torque[k])
    share = needs[worst] / robot.max_torque[worst]
    return CheckFinding.ok(
        "arms",
        f"push-ups with straight arms need {needs[worst]:.2f} N·m at "
        f"'{robot.joint_names[worst]}', {share:.0%} of its stall torque",
    )
