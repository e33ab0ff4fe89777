"""Fields of requests whose robot can be looked at while the work runs."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.jobs.requests.backend import BackendOptions


@dataclass(frozen=True, kw_only=True)
class OnlookerOptions(BackendOptions):
    """Onlookers of a robot besides the command."""

    view: bool = False
    """Show a simulated robot in MuJoCo's own viewer while it moves, no faster than in real time."""
    live: bool = False
    """Let other programs of this user follow it, and stop it: the Live tab of `getup studio`. A
    simulated robot moves no faster than in real time."""

    def find_problems(self) -> list[str]:
        """Report a viewer of a real robot as well."""
        problems = super().find_problems()
        if self.view and self.is_real:
            problems.append("--view is given, expected a simulated robot with it")
        return problems
