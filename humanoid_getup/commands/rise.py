"""`getup rise`: the main job."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from rich.console import Console
from tyro.conf import arg

from drivers import GuardLimits, SafetyGuard
from humanoid_getup.attempt import AttemptOptions
from humanoid_getup.attempt_result import PhaseChange
from humanoid_getup.commands.bodies import Body
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.flights import recording
from humanoid_getup.commands.inputs import TrialOptions, find_start, find_start_faults
from humanoid_getup.commands.results import hand_over
from humanoid_getup.database import load_database
from humanoid_getup.lying import Fall
from humanoid_getup.rise import Rise, get_up
from humanoid_getup.rise_plan import RiseOptions
from humanoid_getup.rising import RisePlanner
from humanoid_getup.start import check_start
from humanoid_getup.stop_key import StopKey
from humanoid_getup.watch import Watch

WHERE_IT_LAY = "where the robot lay"


@dataclass(frozen=True, kw_only=True)
class RiseCommand(TrialOptions):
    """Get up from a fall: plan, filter through physics, play, judge."""

    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """How a simulated robot lies: class of the fall to draw, or a posture file."""
    attempts: int = 3
    """How often to try before asking for help."""
    planning: bool = True
    """Plan a path to the rising motion, or go there straight."""
    filtering: bool = True
    """Send the path through physics, or play it as it is; never on a real robot."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        faults += find_start_faults(self.origin, is_real=self.is_real, needs_one=True)
        if self.attempts < 1:
            faults.append(f"attempts is {self.attempts}, allowed 1 or more")
        if self.is_real and not self.filtering:
            faults.append("no-filtering is allowed only for a simulated robot")
        return faults

    def run(self) -> int:
        """Lie down, or find the robot lying, and rise."""
        stage = self.load_stage()
        with refusing():
            database = load_database(stage.robot)
        rng = np.random.default_rng(self.seed)
        with Console(stderr=True).status("falling") as status, self.open_body(stage) as body:
            options = RiseOptions(
                planning=self.planning,
                filtering=self.filtering,
                torque_limit=self.torque_limit,
                pwm_limited=body.has_servos,
            )
            planner = RisePlanner(stage, database, options)
            start = None if self.origin is None else find_start(stage, self.origin, rng)
            rise = self._rise(planner, body, start, rng, status.update)
            status.update("drawing")
            extra = {"planning": self.planning, "filtering": self.filtering}
            return hand_over(rise, stage, self, self.origin or WHERE_IT_LAY, extra)

    def _rise(
        self,
        planner: RisePlanner,
        body: Body,
        start: Fall | None,
        rng: np.random.Generator,
        tell: Callable[[str], None],
    ) -> Rise:
        stage, simulation = planner.stage, body.simulation
        guard = SafetyGuard(body.backend, GuardLimits.of(stage.robot, self.torque_limit))
        if start is not None and body.place is not None:
            check_start(stage, start.posture)
            body.place(start.posture)
        options = AttemptOptions(
            max_attempts=self.attempts,
            torque_limit=self.torque_limit,
            pwm_limited=body.has_servos,
            # Without the filter, what is asked for is to see the raw path fail or stand.
            preflight=self.filtering,
            realtime=body.realtime,
        )
        about = {"seed": self.seed, "scene": self.scene, "backend": self.backend}
        with recording(self.out, stage.robot, about) as recorder, stop_key(body, guard):

            def hear(change: PhaseChange) -> None:
                tell(change.phase.value)
                recorder.note(change)

            return get_up(
                guard,
                stage,
                planner,
                rng,
                options,
                judge=simulation and (lambda: Watch(simulation, self.torque_limit)),
                start_class=start and start.start_class,
                services=body.services,
                report=hear,
                on_cycle=recorder.log,
            )


def stop_key(body: Body, guard: SafetyGuard) -> StopKey | nullcontext[None]:
    """Let any key of the terminal stop a robot that lives at the speed of life."""
    return StopKey(guard.stop) if body.realtime else nullcontext()
