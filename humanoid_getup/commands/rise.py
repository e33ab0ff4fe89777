"""`getup rise`: the main job."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import arg

from drivers import Twin
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import TrialOptions, find_start
from humanoid_getup.commands.results import hand_over
from humanoid_getup.database import load_database
from humanoid_getup.rise import rise
from humanoid_getup.rise_plan import RiseOptions, RisePlan
from humanoid_getup.rising import RisePlanner
from robots import Posture


@dataclass(frozen=True, kw_only=True)
class RiseCommand(TrialOptions):
    """Get up from a fall: plan, filter through physics, play, judge."""

    origin: Annotated[str, arg(name="from", metavar="supine|prone|left|right|FILE")]
    """Class of the fall to draw, or a posture file."""
    planning: bool = True
    """Plan a path to the rising motion, or go there straight."""
    filtering: bool = True
    """Send the path through physics, or play it as it is."""

    def run(self) -> int:
        """Draw a fall and rise from it."""
        stage = self.load_stage()
        with refusing():
            database = load_database(stage.robot)
        rng = np.random.default_rng(self.seed)
        with Console(stderr=True).status("falling") as status:
            fall = find_start(stage, self.origin, rng)
            options = RiseOptions(
                planning=self.planning, filtering=self.filtering, torque_limit=self.torque_limit
            )
            planner = _ToldPlanner(stage, database, options)
            planner.tell = status.update
            twin = Twin(stage.robot, stage.model)
            start, kind = fall.posture, fall.start_class
            result = rise(twin, planner, start, kind, rng, realtime=self.realtime)
            status.update("drawing")
            extra = {"planning": self.planning, "filtering": self.filtering}
            return hand_over(result, stage, self, self.origin, extra)


class _ToldPlanner(RisePlanner):
    """A planner that says what is going on."""

    tell: Callable[[str], None]

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise from a posture at rest."""
        self.tell("planning and filtering")
        plan = super().plan(start, rng)
        self.tell("playing")
        return plan
