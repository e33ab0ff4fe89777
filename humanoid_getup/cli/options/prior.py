"""Options of `getup prior`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.cli.checks import at_least
from humanoid_getup.cli.options.shared import Count, RobotOption, Seed
from humanoid_getup.cli.output import find_folder_faults


@dataclass(frozen=True, kw_only=True)
class MakePrior(RobotOption):
    """Plan many rises and fit the pose prior to them, which styled policies are trained with."""

    out: Annotated[Path, arg(metavar="DIR")]
    """Folder for prior.npz, rises.npz and the planned motions; the same command continues."""
    rises: Annotated[int, at_least(4, step=4)] = 1000
    """Number of rises to plan, equally many of each class; policies add half as many."""
    policies: Annotated[tuple[str, ...], arg(metavar="POLICY,...")] = ("robust", "gentle")
    """Policies of the robot that add rises; '' for none."""
    jobs: Count = 2
    """Number of processes that plan."""
    epochs: Annotated[int, at_least(1)] = 100
    """Passes over the postures."""
    fitted: Annotated[Path | None, arg(metavar="FILE.npz")] = None
    """Keep a prior that was fitted before, and only collect rises."""
    seed: Seed = 0

    def find_faults(self) -> list[str]:
        """Report a folder that cannot be written, too."""
        return super().find_faults() + find_folder_faults(self.out, ())
