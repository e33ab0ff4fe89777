"""`getup rise`: the main job."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.checks import at_least, positive
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.options import (
    Origin,
    PolicyName,
    RunOptions,
    find_start,
    find_start_faults,
    load_policy,
)
from humanoid_getup.cli.output import phase

if TYPE_CHECKING:
    from humanoid_getup.cli.backends import BackendChoice
    from humanoid_getup.motions.motion_database import MotionDatabase
    from humanoid_getup.simulation.world import World
    from humanoid_getup.strategies.learned_rise import LearnedRise
    from humanoid_getup.strategies.plan import Strategy
    from humanoid_getup.strategies.track_record import TrackRecord, Way
    from robots import Robot


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
            import numpy as np

            from humanoid_getup.cli.results import hand_over
            from humanoid_getup.cli.session import WHERE_IT_LAY, try_to_rise

            world = self.load_stage()
        means = self._load_means(world.robot)
        rng = np.random.default_rng(self.seed)
        with phase("sampling a fall") as tell, self.open_body(world) as body:
            plans = self._make_plans(world, body, means)
            start = None if self.origin is None else find_start(world, self.origin, rng)
            rise = try_to_rise(
                world,
                body,
                plans,
                start,
                self,
                rng,
                attempts=self.attempts,
                # Without the filter, the purpose is to see whether the raw path stands.
                preflight=self.filtering,
                tell=tell,
            )
            tell("drawing")
            extra = {
                "method": self.method,
                "planning": self.planning,
                "filtering": self.filtering,
            }
            return hand_over(rise, world, self, self.origin or WHERE_IT_LAY, extra)

    def _load_means(self, robot: Robot) -> _Means:
        """Load what the method needs, before any robot is touched."""
        from humanoid_getup.motions.motion_database import load_database
        from humanoid_getup.strategies.learned_rise import LearnedRise
        from humanoid_getup.strategies.track_record import POLICY, TrackRecord, Way, load_records

        with refusing():
            records = load_records(robot) if self.method == "auto" else TrackRecord()
            database = None if self.method == POLICY else load_database(robot)
        learned = self.method == POLICY or records.knows(Way(POLICY, self.policy))
        policy = load_policy(robot, self.policy, self.torque_limit) if learned else None
        return _Means(database, policy and LearnedRise(policy, self.policy), records)

    def _make_plans(self, world: World, body: BackendChoice, means: _Means) -> Strategy:
        from humanoid_getup.strategies.plan import RiseOptions
        from humanoid_getup.strategies.planned_rise import PlannedRise
        from humanoid_getup.strategies.selection import ByRecord
        from humanoid_getup.strategies.track_record import BY_PWM, BY_TORQUE, PLAN, POLICY, Way

        ways: dict[Way, Strategy] = {}
        if means.database is not None:
            options = RiseOptions(
                planning=self.planning,
                filtering=self.filtering,
                torque_limit=self.torque_limit,
                pwm_limited=body.has_servos,
            )
            ways[Way(PLAN)] = PlannedRise(world, means.database, options)
        if means.policy is not None:
            ways[Way(POLICY, self.policy)] = means.policy
        limit = float(world.robot.max_torque.max())
        cap = BY_PWM if body.has_servos else BY_TORQUE
        return ByRecord(ways, means.records, min(self.torque_limit or limit, limit), cap)


@dataclass(frozen=True)
class _Means:
    """Inputs of the strategies, as far as the method needs them."""

    database: MotionDatabase | None
    policy: LearnedRise | None
    records: TrackRecord


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
            import numpy as np

            from humanoid_getup.cli.results import hand_over
            from humanoid_getup.cli.session import WHERE_IT_LAY, try_to_rise
            from humanoid_getup.strategies.learned_rise import LearnedRise

            world = self.load_stage()
        policy = load_policy(world.robot, self.policy, self.torque_limit, self.longest)
        plans = LearnedRise(policy, Path(self.policy).stem)
        rng = np.random.default_rng(self.seed)
        with phase("sampling a fall") as tell, self.open_body(world) as body:
            start = None if self.origin is None else find_start(world, self.origin, rng)
            rise = try_to_rise(world, body, plans, start, self, rng, attempts=1, tell=tell)
            tell("drawing")
            return hand_over(rise, world, self, self.origin or WHERE_IT_LAY, {"method": "policy"})
