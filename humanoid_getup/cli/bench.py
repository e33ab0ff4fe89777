"""`getup bench NAME`: benchmarks on the twin and on the virtual bus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from humanoid_getup.cli.checks import at_least, between, positive
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.options import (
    MotionName,
    PwmLimited,
    TorqueLimitOption,
    WorldOptions,
    load_policy,
)
from humanoid_getup.cli.output import (
    console_for,
    counting,
    format_figure,
    phase,
    to_json,
    write_json,
)

if TYPE_CHECKING:
    from humanoid_getup.simulation.world import World
    from humanoid_getup.strategies.plan import Strategy
    from robots import TorqueLimit

RISE_FIGURES = ("n", "planned", "stood", "stood_interval_95", "stand_time_s", "plan_s", "filter_s")
MOTION_FIGURES = (
    "stand_time_s",
    "peak_torque_nm",
    "rms_torque_nm",
    "lowest_torque_limit_nm",
    "disturbed_stood",
)
SPEED_FIGURES = ("n", "filter_over_bare_steps_per_s")
FAULT_FIGURES = ("n", "stood", "endings", "safe_max_s", "beyond_limits", "believed_wrong")
SOAK_FIGURES = ("n", "stood", "faster_than_real_time", "cycles", "unexplained_s", "memory_mib")
METHOD_FIGURES = (
    "n",
    "stood",
    "stand_time_s",
    "peak_torque_nm",
    "rms_torque_nm",
    "head_impact_m_s",
    "hottest_after_ten_rises_c",
)

Count = Annotated[int, at_least(1)]


@dataclass(frozen=True, kw_only=True)
class BenchOptions(WorldOptions):
    """Options of every benchmark."""

    n: Count = 1

    def load_stage(self) -> World:
        """Check the options, load the robot, and check that its motions can be loaded."""
        with phase("loading"):
            world = super().load_stage()
            from humanoid_getup.motions.motion_database import load_database

            with refusing():
                load_database(world.robot)
        return world

    def hand_over(self, result: dict[str, Any], figures: tuple[str, ...]) -> int:
        """Write the results, print some of them as a table, and return the exit code.

        The code is 1 if a limit was passed, a wrong position believed, or a robot never safe.
        """
        from rich.table import Table

        write_json(to_json(result), self.json)
        cases = result.get("classes") or result["cases"]
        table = Table(result["name"], *figures, box=None, header_style="bold")
        for name, case in cases.items():
            table.add_row(name, *(format_figure(case.get(figure)) for figure in figures))
        console_for(self.json).print(table)
        harms = ("beyond_limits", "believed_wrong", "never_safe")
        harmed = any(case.get(harm) for case in cases.values() for harm in harms)
        return DID_NOT_STAND if harmed else DID_IT


@dataclass(frozen=True, kw_only=True)
class BenchRise(BenchOptions):
    """Rise from many settled falls: success rates, times and faults."""

    n: Count = 20
    """Falls of each class: supine, prone, lateral."""
    torque_limit: TorqueLimitOption = None
    planning: bool = True
    """Plan a collision-free path to the rising motion; otherwise interpolate."""
    filtering: bool = True
    """Filter the path through physics; otherwise play it unfiltered."""
    assistance: Annotated[float, between(0.0, 1.0)] = 1.0
    """Factor on the virtual actuator's torques in the filter; 0 is plain tracking."""
    pwm_limited: PwmLimited = False

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        from humanoid_getup.benchmarks.rise import CLASSES, bench_rise
        from humanoid_getup.strategies.plan import RiseOptions
        from robots import TorqueLimit

        options = RiseOptions(
            planning=self.planning,
            filtering=self.filtering,
            assistance=self.assistance,
            torque_limit=TorqueLimit(self.torque_limit, "pwm" if self.pwm_limited else "torque"),
        )
        with counting("rises", len(CLASSES) * self.n) as count:
            result = bench_rise(
                world.robot,
                world.scene,
                seed=self.seed,
                each=self.n,
                options=options,
                report=lambda _: count(1),
            )
        return self.hand_over(result, RISE_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BenchMotions(BenchOptions):
    """Play every motion of the database: time, load, reserve and robustness."""

    n: Count = 50
    """Disturbed plays of each motion."""

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        from humanoid_getup.benchmarks.motions import bench_motions
        from humanoid_getup.motions.motion_database import MOTION_FOLDER

        motions = len(list((world.robot.folder / MOTION_FOLDER).glob("*.npz")))
        with counting("motions", motions) as count:
            robot, scene = world.robot, world.scene
            result = bench_motions(
                robot, scene, seed=self.seed, plays=self.n, report=lambda _: count(1)
            )
        return self.hand_over(result, MOTION_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BenchFilter(BenchOptions):
    """Compare the speed of the filter's simulation with bare physics."""

    n: Count = 5
    """Repetitions."""

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        from humanoid_getup.benchmarks.speed import bench_filter

        with phase("filtering"):
            result = bench_filter(world.robot, world.scene, seed=self.seed, repeats=self.n)
        return self.hand_over(result, SPEED_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BenchFaults(BenchOptions):
    """Inject each kind of fault in the middle of a rise; exit code 1 if any was unsafe."""

    n: Count = 20
    """Rises of each case."""
    motion: MotionName = "supine_roll_over"

    def run(self) -> int:
        """Run the benchmark."""
        from humanoid_getup.benchmarks.fault_injection import CASES, bench_faults

        return self._run_cases(bench_faults, "cases", len(CASES))

    def _run_cases(self, bench: Callable[..., dict[str, Any]], what: str, total: int) -> int:
        from humanoid_getup.cli.rising import find_motion

        world = self.load_stage()
        motion = find_motion(world.robot, self.motion)
        with counting(what, total) as count:
            result = bench(world, motion, seed=self.seed, each=self.n, report=lambda _: count(1))
        return self.hand_over(result, FAULT_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BenchKill(BenchFaults):
    """Kill the program (SIGKILL) in the middle of a rise, and measure when the servos stop."""

    n: Count = 20
    """Kills."""

    def run(self) -> int:
        """Run the benchmark."""
        from humanoid_getup.benchmarks.fault_injection import bench_kill

        return self._run_cases(bench_kill, "kills", self.n)


@dataclass(frozen=True, kw_only=True)
class BenchSoak(BenchOptions):
    """Rise, sit, tumble and rise again on the virtual bus, as long as requested."""

    duration: Annotated[float, positive("s", at_most=1e6), arg(metavar="S")] = 1800.0
    """Time on the bus [s]."""

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        from humanoid_getup.benchmarks.soak import bench_soak

        passed = 0.0
        with counting("bus time [s]", round(self.duration)) as count:

            def report(now: float) -> None:
                nonlocal passed
                count(now - passed)
                passed = now

            result = bench_soak(
                world.robot, world.scene, seed=self.seed, duration=self.duration, report=report
            )
        return self.hand_over(result, SOAK_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BenchMethods(BenchOptions):
    """Get up from the same falls by plans and by policies: success, time, load, impact, heat."""

    n: Count = 20
    """Falls of each class: supine, prone, lateral."""
    ways: tuple[str, ...] = ("plan", "robust")
    """Strategies to compare: plan, and policies by name or file."""
    torque_limit: TorqueLimitOption = None
    pwm_limited: PwmLimited = False

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        from humanoid_getup.benchmarks.rise import CLASSES, bench_methods
        from robots import TorqueLimit

        limit = TorqueLimit(self.torque_limit, "pwm" if self.pwm_limited else "torque")
        strategies = {name: self._make_strategy(world, name, limit) for name in self.ways}
        with counting("rises", len(CLASSES) * self.n * len(strategies)) as count:
            result = bench_methods(
                world,
                strategies,
                seed=self.seed,
                each=self.n,
                torque_limit=limit,
                report=lambda _: count(1),
            )
        return self.hand_over(result, METHOD_FIGURES)

    def _make_strategy(self, world: World, name: str, limit: TorqueLimit) -> Strategy:
        from humanoid_getup.motions.motion_database import load_database
        from humanoid_getup.strategies.learned_rise import LearnedRise
        from humanoid_getup.strategies.plan import RiseOptions
        from humanoid_getup.strategies.planned_rise import PlannedRise
        from humanoid_getup.strategies.track_record import PLAN

        if name != PLAN:
            return LearnedRise(load_policy(world.robot, name, self.torque_limit), name)
        with refusing():
            database = load_database(world.robot)
        return PlannedRise(world, database, RiseOptions(torque_limit=limit))
