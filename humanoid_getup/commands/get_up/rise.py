"""`getup rise`: get up by a plan, by a policy, or by the better of both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from humanoid_getup.commands.command import command
from humanoid_getup.commands.get_up.operator_key import watch_key
from humanoid_getup.commands.get_up.options import GetUpOptions, StyleOption
from humanoid_getup.commands.get_up.results import FinishedRise, print_rise
from humanoid_getup.commands.get_up.rise_session import run_session
from humanoid_getup.commands.get_up.session_hooks import Operator
from humanoid_getup.commands.inputs import load_keys, load_world, make_settings
from humanoid_getup.commands.options import (
    A_POLICY,
    Count,
    Keys,
    LoadOption,
    PlannerOptions,
    PolicyName,
)
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import choose_strategy
from humanoid_getup.strategies.plan import Strategy


@dataclass(frozen=True, kw_only=True)
class RiseRequest(LoadOption, PlannerOptions, GetUpOptions):
    """Get up from a fall: plan, filter through physics, play, judge; or run a policy."""

    attempts: Count = 3
    """Number of attempts before giving up."""
    method: Literal["plan", "policy", "auto"] = "plan"
    """Plan a motion, run a policy, or use the one with the better track record for the start."""
    policy: PolicyName | None = None
    """With --method policy or auto; default: robust, or styled with --style."""
    style: StyleOption = None
    key: Keys = ()

    @property
    def most_attempts(self) -> int:
        """Return the number of attempts before giving up."""
        return self.attempts

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.method == "plan" and self.policy is not None:
            yield f"--policy is {self.policy}, expected --method policy or auto with it"
        named = self.name_objective()
        if named and self.method == "policy":
            yield f"{named}: expected --method plan or auto with it"
        if self.style is not None and self.method != "policy":
            yield f"--style is {self.style}, expected --method policy with it"
        if self.method == "policy":
            yield from self.refuse_body(A_POLICY)
        if self.key and not (self.method == "plan" and self.planning and self.filtering):
            yield "--key: expected --method plan with it, planning and filtering"
        if named and not self.filtering:
            yield f"{named}: expected filtering, not --no-filtering"
        if self.is_real and not self.filtering:
            yield "--no-filtering requires a simulated robot"


@command("rise", json=FinishedRise.describe, person=watch_key, in_lines=True)
def rise(
    request: RiseRequest, monitor: ProgressMonitor, *, operator: Operator | None = None
) -> FinishedRise:
    """Rise by plan, by policy, or by the better of both.

    Cancellation is checked at every phase, in every control cycle, and between the steps of a plan,
    the longest of which take a few seconds.
    Without an operator, a robot that holds its stand sits down as soon as that is judged.

    Raises:
        CancelledError: if it was canceled; torque is off, and no file is written, except perhaps
            the flight log.
        KeyboardInterrupt: if it was interrupted; torque is off, unless its text says that the
            robot was handed over.
    """
    monitor.begin("loading")
    return run_session(
        request,
        _select_strategy(request, load_world(request), monitor),
        monitor,
        operator,
        # Without the filter, the purpose is to see whether the raw path stands.
        preflight=request.filtering,
    )


rise.show(print_rise)


def _select_strategy(request: RiseRequest, world: World, monitor: ProgressMonitor) -> Strategy:
    """Load the strategy of the method, before any robot is touched."""
    return choose_strategy(
        world,
        request.method,
        make_settings(request, world.robot),
        keys=load_keys(world, request.key),
        policy=request.policy,
        style=request.style,
        origin=request.origin,
        monitor=monitor,
    )
