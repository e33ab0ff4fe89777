"""Readiness: the motions and policies of a robot, and how to get missing ones."""

from __future__ import annotations

from collections.abc import Iterator

from humanoid_getup.motions.motion_database import (
    list_motions,
    load_database,
    name_robot,
    suggest_motions,
)
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.robot_check.finding import CheckFinding
from robots import Robot

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
