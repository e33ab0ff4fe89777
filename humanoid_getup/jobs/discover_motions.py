"""Discovers motions of a robot in the rises of its policy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.output_files import find_folder_problems
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.motions import DiscoverRequest
from humanoid_getup.motions.build import SOUND, motion_file
from humanoid_getup.motions.motion import NAME
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.policy.onnx_policy import find_policy
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.simulation.world import World
from robots import Robot

if TYPE_CHECKING:  # its evaluation of policies is slow to import
    from sim2real.motion_discovery.discovery import Discovery


def discover(
    request: DiscoverRequest, report: Report | None = None, cancel: Cancel | None = None
) -> tuple[Discovery, ...]:
    """Search from each side, and store the motions; return the findings of each side.

    Raises:
        BadInputError: if the policy follows style curves, or its motions are there already.
        CancelledError: if ``cancel`` ended it; motions of the sides that were finished are kept.
    """
    DiscoverRequest.accept(request)
    request, monitor = name_robot(request, request.policy), ProgressMonitor(report, cancel)
    robot = load_robot(request)
    policy = load_policy(robot, request.policy, None)
    if policy.contract.style is not None:
        raise BadInputError(
            f"policy '{request.policy}' follows style curves, expected one without, such as that "
            "of recipe quick"
        )
    name = find_policy(robot, request.policy).stem
    _check_names(robot, name)
    monitor.begin("loading")
    from sim2real.motion_discovery.discovery import SIDES, MotionDiscovery

    discovery = MotionDiscovery(World(robot), policy, policy_name=name, seed=request.seed)
    found: list[Discovery] = []
    for side in SIDES:
        count = monitor.count(f"rises ({side})", request.rises)
        found.append(discovery.search(side, request.rises, request.most, count))
        for motion in found[-1].motions:
            motion_file(robot.folder, motion.name).parent.mkdir(exist_ok=True)
            motion.save(motion_file(robot.folder, motion.name))
        for line in _describe(found[-1]):
            monitor.tell(line)
    return tuple(found)


def _check_names(robot: Robot, policy: str) -> None:
    """Refuse a policy whose name is no name of a motion, or whose motions exist already."""
    folder = robot.folder / MOTION_FOLDER
    if problems := find_folder_problems(folder, ()):
        raise BadInputError("; ".join(problems))
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
    for motion in found.motions:
        share = float(motion.provenance["disturbed_success"])
        lines.append(
            f"motion '{motion.name}' ({motion.strategy}) stands after {motion.stand_time:.2f} s, "
            f"in {share:.0%} of disturbed worlds"
        )
    if not found.motions:
        lines.append(
            f"no motion from {found.start_class}: the best stood in {found.best_share:.0%} of "
            f"disturbed worlds, expected {SOUND:.0%} and a passed preflight (train longer, or try "
            "more --rises)"
        )
    return lines
