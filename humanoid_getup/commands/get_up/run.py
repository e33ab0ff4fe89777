"""`getup run`: get up once by a policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.files import ROBOT
from humanoid_getup.commands.get_up.operator_key import watch_key
from humanoid_getup.commands.get_up.options import GetUpOptions, StyleOption
from humanoid_getup.commands.get_up.results import FinishedRise, print_rise
from humanoid_getup.commands.get_up.rise_session import run_session
from humanoid_getup.commands.get_up.session_hooks import Operator
from humanoid_getup.commands.inputs import load_world, make_torque_limit
from humanoid_getup.commands.options import PolicyName
from humanoid_getup.commands.policies import load_policy, name_robot
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.strategies.choice import POLICY, apply_style
from humanoid_getup.strategies.learned_rise import LearnedRise
from robots.storage.validation import between


@dataclass(frozen=True, kw_only=True)
class RunRequest(GetUpOptions):
    """Run a trained policy once, supervised, and judge how it ends."""

    method: ClassVar[str] = POLICY
    policy: Positional[PolicyName]
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
    style: StyleOption = None
    longest: Annotated[float | None, between(0.001, 1e6, "s"), arg(metavar="S")] = None
    """Time after which the run ends, standing or not [s]; default: 12."""


@command("run", json=FinishedRise.describe, person=watch_key, in_lines=True)
def run_policy(
    request: RunRequest, monitor: ProgressMonitor, *, operator: Operator | None = None
) -> FinishedRise:
    """Rise once by a policy, as `rise` does, with the same errors."""
    monitor.begin("loading")
    request = name_robot(request, request.policy)
    world = load_world(request)
    policy = load_policy(world.robot, request.policy, request.torque_limit, request.longest)
    name = Path(request.policy).stem
    limit = make_torque_limit(request, world.robot)
    learned = LearnedRise(world, policy, torque_limit=limit, name=name)
    strategy = apply_style(learned, request.style, monitor)
    return run_session(request, strategy, monitor, operator)


run_policy.show(print_rise)
