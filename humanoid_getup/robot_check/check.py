"""The whole check of a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from humanoid_getup.motions.motion_database import (
    list_motions,
    load_database,
    name_robot,
    suggest_motions,
)
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.robot_check.ability_check import check_arms, check_depth, check_strength
from humanoid_getup.robot_check.finding import CheckFinding
from humanoid_getup.robot_check.model_check import check_body, check_mirrors, check_turns
from humanoid_getup.robot_check.stance_check import check_hold, check_soles, check_stance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.limbs import Limbs
from robots.body.squats import Squat, list_squats
from robots.body.statics import Statics

ABILITIES = ("squats", "strength", "arms", "holding the stance")


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotCheck:
    """Findings of a robot check."""

    findings: tuple[CheckFinding, ...]
    squats: tuple[Squat, ...]
    """Balanced squats from high to deep."""
    unchecked: tuple[str, ...] = ()
    """Parts that are not checked until the faults are corrected."""

    @property
    def is_sound(self) -> bool:
        """Return whether there is no fault."""
        return not _has_fault(self.findings)


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
    findings += check_readiness(robot)
    return RobotCheck(findings=tuple(findings), squats=tuple(squats), unchecked=unchecked)


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


def check_readiness(robot: Robot) -> Iterator[CheckFinding]:
    """Find the sides from which a robot has motions, and its policies."""
    yield _check_motions(robot)
    yield _check_policies(robot)


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
