"""`getup motions discover`: motions of a robot from the rises of its policy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console

from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.discover import DiscoverMotions
from humanoid_getup.cli.output import console_for, counting, find_folder_faults, phase
from humanoid_getup.cli.policies import load_policy, name_robot
from humanoid_getup.motions.build import SOUND, motion_file
from humanoid_getup.motions.motion import NAME
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.policy.onnx_policy import find_policy
from humanoid_getup.simulation.world import World
from robots import Robot

if TYPE_CHECKING:  # its evaluation of policies is slow to import
    from sim2real.motion_discovery.discovery import Discovery


def discover(command: DiscoverMotions) -> int:
    """Search from each side; keep the motions, report the sides from which there are none."""
    command = name_robot(command, command.policy)
    robot = load_robot(command)
    policy = load_policy(robot, command.policy, None)
    if policy.contract.style is not None:
        raise BadInputError(
            f"policy '{command.policy}' follows style curves, expected one without, such as that "
            "of recipe quick"
        )
    name = find_policy(robot, command.policy).stem
    _check_names(robot, name)
    with phase("loading"):
        from sim2real.motion_discovery.discovery import SIDES, MotionDiscovery
    discovery = MotionDiscovery(World(robot), policy, policy_name=name, seed=command.seed)
    console, missing = console_for(None), 0
    for side in SIDES:
        with counting(f"rises ({side})", command.rises) as count:
            found = discovery.search(side, command.rises, command.most, count)
        for motion in found.motions:
            motion_file(robot.folder, motion.name).parent.mkdir(exist_ok=True)
            motion.save(motion_file(robot.folder, motion.name))
        _report(console, found)
        missing += not found.motions
    return DID_NOT_STAND if missing else DID_IT


def _check_names(robot: Robot, policy: str) -> None:
    """Refuse a policy whose name cannot be that of a motion, or whose motions are there already."""
    folder = robot.folder / MOTION_FOLDER
    if faults := find_folder_faults(folder, ()):
        raise BadInputError("; ".join(faults))
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


def _report(console: Console, found: Discovery) -> None:
    """Print how many rises stood, and what was found."""
    console.print(
        f"{found.start_class}: the policy stood in {found.learned} of {found.tried} rises, "
        f"{found.replayed} stand without it",
        markup=False,
    )
    for motion in found.motions:
        share = float(motion.provenance["disturbed_success"])
        console.print(
            f"motion '{motion.name}' ({motion.strategy}) stands after {motion.stand_time:.2f} s, "
            f"in {share:.0%} of disturbed worlds",
            markup=False,
        )
    if not found.motions:
        console.print(
            f"no motion from {found.start_class}: the best stood in {found.best_share:.0%} of "
            f"disturbed worlds, expected {SOUND:.0%} and a passed preflight (train longer, or try "
            "more --rises)",
            markup=False,
        )
