"""Readiness: what a robot has to get up by, motions and policies, and how to come by them."""

from __future__ import annotations

from collections.abc import Iterator

from humanoid_getup.motions.motion_database import MOTION_FOLDER, load_database
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.robot_check.finding import Finding
from robots import Robot
from robots.robot import ROBOTS_FOLDER

LYING = ("supine", "prone", "left", "right")


def check_readiness(robot: Robot) -> Iterator[Finding]:
    """Find from which sides a robot knows how to get up."""
    yield _check_motions(robot)
    yield _check_policies(robot)


def _check_motions(robot: Robot) -> Finding:
    retarget = f"getup motions retarget {_option(robot)} --source op3"
    if not any((robot.folder / MOTION_FOLDER).glob("*.npz")):
        return Finding(
            level="warning",
            subject="motions",
            text="there are none, so no rise can be planned",
            remedy=retarget,
        )
    try:
        rising = load_database(robot).rising
    except ValueError as error:
        return Finding(
            level="fault", subject="motions", text=str(error), remedy="build or remove them"
        )
    known = {motion.start_class for motion in rising}
    missing = [side for side in LYING if side not in known]
    sides = ", ".join(side for side in LYING if side in known)
    if missing:
        return Finding(
            level="warning",
            subject="motions",
            text=f"{len(rising)} that rise, from {sides or 'no side'}; none from "
            f"{', '.join(missing)}",
            remedy=f"{retarget}, or getup motions build with keys of your own",
        )
    text = f"{len(rising)} that rise, mirrored ones included, from {sides}"
    return Finding(level="ok", subject="motions", text=text)


def _check_policies(robot: Robot) -> Finding:
    names = [file.stem for file in list_policies(robot)]
    if names:
        return Finding(level="ok", subject="policies", text=", ".join(names))
    return Finding(
        level="ok",
        subject="policies",
        text="there are none; rises are planned",
        remedy=f"getup train {_option(robot)} --recipe quick --out out/quick",
    )


def _option(robot: Robot) -> str:
    is_ours = robot.folder.parent == ROBOTS_FOLDER
    return f"--robot {robot.name if is_ours else robot.folder}"
