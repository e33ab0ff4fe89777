"""Motions of the rises of a policy: replayed without feedback, as smooth as they still stand."""

from __future__ import annotations

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.motions.discover_motions import (
    DiscoveredMotions,
    DiscoverRequest,
    check_files,
)
from humanoid_getup.commands.motions.search_motions import choose_sides, describe_motion
from humanoid_getup.commands.policies import load_policy, name_robot
from humanoid_getup.motions.build import SOUND, motion_file
from humanoid_getup.motions.motion import NAME
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.policy.onnx_policy import find_policy
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Robot
from sim2real.motion_discovery import Discovery, MotionDiscovery

RISES = 48


def harvest_policy(request: DiscoverRequest, monitor: ProgressMonitor) -> DiscoveredMotions:
    """Make motions of the rises of a policy from each side."""
    request = name_robot(request, request.policy)
    robot = load_robot(request)
    policy = load_policy(robot, request.policy, None)
    if policy.contract.style is not None:
        raise BadInputError(
            f"policy '{request.policy}' follows style curves, expected one without, such as that "
            "of recipe quick"
        )
    name = find_policy(robot, request.policy).stem
    check_files(robot, request)
    _check_name(robot, name)
    discovery = MotionDiscovery(World(robot), policy, policy_name=name, seed=request.seed)
    found: list[Discovery] = []
    rises = request.rises or RISES
    for side in choose_sides(request, robot):
        count = monitor.count(f"rises ({side})", rises)
        found.append(discovery.search(side, rises, request.most, count))
        for motion in found[-1].motions:
            motion_file(robot.folder, motion.name).parent.mkdir(exist_ok=True)
            motion.save(motion_file(robot.folder, motion.name))
        for line in _describe(found[-1]):
            monitor.tell(line)
    return DiscoveredMotions(
        robot=robot,
        motions=tuple(motion for each in found for motion in each.motions),
        wanting=tuple(each.start_class for each in found if not each.motions),
        goes_on=False,
    )


def _check_name(robot: Robot, policy: str) -> None:
    """Refuse a policy whose name is no name of a motion, or whose motions exist already."""
    folder = robot.folder / MOTION_FOLDER
    if not NAME.fullmatch(policy):
        raise BadInputError(
            f"policy file is named {policy!r}, expected letters, digits, '_', '-' and '.': motions "
            "are named after it"
        )
    there = sorted(path.stem for path in folder.glob(f"*_{policy}_[0-9]*.npz"))
    if there:
        raise BadInputError(
            f"motions of policy '{policy}' are there already: {', '.join(there)}; remove them "
            f"from {folder} first"
        )


def _describe(found: Discovery) -> list[str]:
    """Describe how many rises stood, and the motions found."""
    lines = [
        f"{found.start_class}: the policy stood in {found.learned} of {found.tried} rises, "
        f"{found.replayed} stand without it"
    ]
    lines += [describe_motion(motion) for motion in found.motions]
    if not found.motions:
        lines.append(
            f"no motion from {found.start_class}: the best stood in {found.best_share:.0%} of "
            f"disturbed worlds, expected {SOUND:.0%} and a passed preflight (train longer, or try "
            "more --rises)"
        )
    return lines
