"""`getup rise` and `getup run`: the main job, by plan or by policy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import at_least, positive
from humanoid_getup.cli.options import Origin, PolicyName, RunOptions, find_start_faults
from humanoid_getup.cli.output import phase


@dataclass(frozen=True, kw_only=True)
class RiseCommand(RunOptions):
    """Get up from a fall: plan, filter through physics, play, judge; or run a policy."""

    origin: Origin = None
    attempts: Annotated[int, at_least(1)] = 3
    """Number of attempts before giving up."""
    method: Literal["plan", "policy", "auto"] = "plan"
    """Plan a motion, run a policy, or use what has the better track record for the start."""
    policy: PolicyName = "robust"
    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered (simulated robots only)."""

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        faults = super().find_faults()
        faults += find_start_faults(self.origin, is_real=self.is_real, needs_one=True)
        if self.is_real and not self.filtering:
            faults.append("--no-filtering requires a simulated robot")
        return faults

    def run(self) -> int:
        """Place the robot, or find it lying, and rise."""
        with phase("loading"):
            from humanoid_getup.cli.rising import rise
        return rise(self)


@dataclass(frozen=True, kw_only=True)
class RunPolicy(RunOptions):
    """Run a trained policy once, supervised, and judge how it ends."""

    policy: Positional[PolicyName]
    origin: Origin = None
    longest: Annotated[float | None, positive("s"), arg(metavar="S")] = None
    """Time after which the run ends, standing or not [s]; default: 12."""

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        faults = super().find_faults()
        return faults + find_start_faults(self.origin, is_real=self.is_real, needs_one=True)

    def run(self) -> int:
        """Place the robot, or find it lying, and let the policy rise."""
        with phase("loading"):
            from humanoid_getup.cli.rising import run_policy
        return run_policy(self)
