"""`getup rise`: the main job."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.cli.backends import BackendChoice
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.options import RunOptions, find_start, find_start_faults, load_policy
from humanoid_getup.cli.results import hand_over
from humanoid_getup.cli.session import WHERE_IT_LAY, open_session
from humanoid_getup.execution.get_up import get_up, lay_down
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.policy.onnx_policy import LONGEST
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import RiseOptions, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.selection import StrategySelector
from humanoid_getup.strategies.track_record import (
    PLAN,
    POLICY,
    StrategyId,
    TrackRecord,
    load_track_record,
)
from robots import Robot

AUTO = "auto"
METHODS = (PLAN, POLICY, AUTO)


@dataclass(frozen=True, kw_only=True)
class RiseCommand(RunOptions):
    """Get up from a fall: plan, filter through physics, play, judge; or run a policy."""

    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """How a simulated robot lies: class of the fall to draw, or a posture file."""
    attempts: int = 3
    """How often to try before asking for help."""
    method: Annotated[str, arg(metavar="plan|policy|auto")] = PLAN
    """Plan a motion, run a trained policy, or what has the better record for how it lies."""
    policy: Annotated[str, arg(metavar="NAME|FILE")] = "robust"
    """A policy's name in the robot's folder, or an .onnx file."""
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
        if self.method not in METHODS:
            faults.append(f"method is '{self.method}', allowed {', '.join(METHODS)}")
        if self.is_real and not self.filtering:
            faults.append("no-filtering is allowed only for a simulated robot")
        return faults

    def run(self) -> int:
        """Lie down, or find the robot lying, and rise."""
        world = self.load_stage()
        loaded = self._load(world.robot)
        rng = np.random.default_rng(self.seed)
        with Console(stderr=True).status("falling") as status, self.open_body(world) as body:
            strategy = self._make_strategy(world, body, loaded)
            rise = rise_from(
                self,
                world,
                body,
                strategy,
                rng,
                report=status.update,
                max_attempts=self.attempts,
                preflight=self.filtering,  # an unfiltered path is played to see it fail or stand
            )
            status.update("drawing")
            extra = {
                "method": self.method,
                "planning": self.planning,
                "filtering": self.filtering,
            }
            return hand_over(rise, world, self, self.origin or WHERE_IT_LAY, extra)

    def _load(self, robot: Robot) -> _Loaded:
        """Load what the method needs, before any robot is touched."""
        with refusing():
            records = load_track_record(robot) if self.method == AUTO else TrackRecord()
            database = None if self.method == POLICY else load_database(robot)
        learned = self.method == POLICY or records.knows(StrategyId(POLICY, self.policy))
        policy = load_policy(robot, self.policy, self.torque_limit) if learned else None
        return _Loaded(database, policy and LearnedRise(policy, self.policy), records)

    def _make_strategy(self, world: World, body: BackendChoice, loaded: _Loaded) -> Strategy:
        limit = body.limit_torque(self.torque_limit)
        strategies: dict[StrategyId, Strategy] = {}
        if loaded.database is not None:
            options = RiseOptions(
                planning=self.planning,
                filtering=self.filtering,
                torque_limit=limit,
            )
            strategies[StrategyId(PLAN)] = PlannedRise(world, loaded.database, options)
        if loaded.policy is not None:
            strategies[StrategyId(POLICY, self.policy)] = loaded.policy
        return StrategySelector(strategies, loaded.records, limit)


def rise_from(
    command: RiseCommand | RunPolicy,
    world: World,
    body: BackendChoice,
    strategy: Strategy,
    rng: np.random.Generator,
    *,
    report: Callable[[str], None],
    **options: Any,
) -> RiseResult:
    """Lay a simulated robot down as a command wants it, or leave it where it lies; get it up."""
    start = None if command.origin is None else find_start(world, command.origin, rng)
    if start is not None and body.place is not None:
        lay_down(world, start, body.place)
    with open_session(command, world, body, strategy, report=report, **options) as session:
        return get_up(session, rng, start_class=start and start.start_class)


@dataclass(frozen=True)
class _Loaded:
    """What the strategies are made of, as far as the method needs them."""

    database: MotionDatabase | None
    policy: LearnedRise | None
    records: TrackRecord


@dataclass(frozen=True, kw_only=True)
class RunPolicy(RunOptions):
    """Run a trained policy once, supervised, and judge how it ends."""

    policy: Annotated[Positional[str], arg(metavar="POLICY")]
    """A policy's name in the robot's folder, or an .onnx file."""
    origin: Annotated[str | None, arg(name="from", metavar="supine|prone|left|right|FILE")] = None
    """How a simulated robot lies: class of the fall to draw, or a posture file."""

    longest: Annotated[float, arg(metavar="S")] = LONGEST
    """Time after which it ends, standing or not [s]."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        faults += find_start_faults(self.origin, is_real=self.is_real, needs_one=True)
        if not 0.0 < self.longest < math.inf:
            faults.append(f"longest is {self.longest:g} s, allowed a finite number above 0 s")
        return faults

    def run(self) -> int:
        """Lie down, or find the robot lying, and let the policy rise."""
        world = self.load_stage()
        policy = load_policy(world.robot, self.policy, self.torque_limit, self.longest)
        strategy = LearnedRise(policy, Path(self.policy).stem)
        rng = np.random.default_rng(self.seed)
        with Console(stderr=True).status("falling") as status, self.open_body(world) as body:
            rise = rise_from(self, world, body, strategy, rng, report=status.update, max_attempts=1)
            status.update("drawing")
            return hand_over(rise, world, self, self.origin or WHERE_IT_LAY, {"method": "policy"})
