"""`getup play MOTION`: a rise by one fixed motion."""

from __future__ import annotations

from dataclasses import dataclass

from tyro.conf import Positional

from humanoid_getup.cli.options import MotionName, Origin, RunOptions, find_start_faults
from humanoid_getup.cli.output import phase


@dataclass(frozen=True, kw_only=True)
class Play(RunOptions):
    """Play a rising motion and judge how it ends."""

    motion: Positional[MotionName]
    origin: Origin = None
    preflight: bool = True
    """Play only what the preflight passes; simulated robots alone may go without."""

    def find_faults(self) -> list[str]:
        """Report all that is wrong beyond the type and range of single values."""
        faults = super().find_faults()
        if self.is_real and not self.preflight:
            faults.append("--no-preflight requires a simulated robot")
        return faults + find_start_faults(self.origin, is_real=self.is_real, needs_one=False)

    def run(self) -> int:
        """Place the robot, or find it lying, and play."""
        with phase("loading"):
            from humanoid_getup.cli.rising import play
        return play(self)
