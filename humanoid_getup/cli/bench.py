"""`getup bench NAME`: measure on the twin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from tyro.conf import arg

from humanoid_getup.benchmarks.fault_injection import CASES, bench_faults, bench_kill
from humanoid_getup.benchmarks.motions import bench_motions
from humanoid_getup.benchmarks.rise import CLASSES, bench_methods, bench_rise
from humanoid_getup.benchmarks.soak import bench_soak
from humanoid_getup.benchmarks.speed import bench_filter
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.options import WorldOptions, find_torque_faults, load_policy
from humanoid_getup.cli.output import console_for, counting, format_figure, to_json, write_json
from humanoid_getup.cli.play import find_motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER, load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import RiseOptions, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.track_record import PLAN
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


@dataclass(frozen=True, kw_only=True)
class BenchOptions(WorldOptions):
    """What every benchmark is told."""

    n: int = 1

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        return faults if self.n >= 1 else [*faults, f"n is {self.n}, allowed 1 or more"]

    def load_stage(self) -> World:
        """Check the options, load the robot, and see that its motions can be loaded."""
        world = super().load_stage()
        with refusing():
            load_database(world.robot)
        return world

    def hand_over(self, result: dict[str, Any], figures: tuple[str, ...]) -> int:
        """Write the figures, and print some of them as a table."""
        write_json(to_json(result), self.json)
        cases = result.get("classes") or result["cases"]
        table = Table(result["name"], *figures, box=None, header_style="bold")
        for name, case in cases.items():
            table.add_row(name, *(format_figure(case.get(figure)) for figure in figures))
        console_for(self.json).print(table)
        return DID_IT


@dataclass(frozen=True, kw_only=True)
class BenchRise(BenchOptions):
    """Rise from many settled falls: success rates, times and faults."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    torque_limit: Annotated[float | None, arg(metavar="N·m")] = None
    """Cap on every servo [N·m]; without it, what the servos can."""
    planning: bool = True
    """Plan a path to the rising motion, or go there straight."""
    filtering: bool = True
    """Send the path through physics, or play it as it is."""
    assistance: float = 1.0
    """Share of the virtual actuator's torques that the filter uses; 0 is plain tracking."""
    pwm_limited: bool = False
    """Let the cap be a PWM limit, as servos in position mode have it."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults() + find_torque_faults(self.torque_limit)
        if not 0.0 <= self.assistance <= 1.0:
            faults.append(f"assistance is {self.assistance}, allowed 0 to 1")
        return faults

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        options = RiseOptions(
            planning=self.planning,
            filtering=self.filtering,
            assistance=self.assistance,
            torque_limit=TorqueLimit(self.torque_limit, "pwm" if self.pwm_limited else "torque"),
        )
        with counting("rises", len(CLASSES) * self.n) as count:
            robot, scene = world.robot, world.scene
            result = bench_rise(
                robot,
                scene,
                seed=self.seed,
                each=self.n,
                options=options,
                report=lambda _: count(1),
            )
        return self.hand_over(result, RISE_FIGURES)


@dataclass(frozen=True, kw_only=True)
class BenchMotions(BenchOptions):
    """Play every motion of the database: time, load, reserve and robustness."""

    n: int = 50
    """Disturbed plays of each motion."""

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
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

    n: int = 5
    """Repetitions."""

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        with Console(stderr=True).status("filtering"):
            result = bench_filter(world.robot, world.scene, seed=self.seed, repeats=self.n)
        return self.hand_over(result, SPEED_FIGURES)


FAULT_FIGURES = ("n", "stood", "endings", "safe_max_s", "beyond_limits", "believed_wrong")
SOAK_FIGURES = ("n", "stood", "faster_than_real_time", "cycles", "unexplained_s", "memory_mib")


@dataclass(frozen=True, kw_only=True)
class BenchFaults(BenchOptions):
    """Break each thing in the middle of a rise, and see what comes of it."""

    n: int = 20
    """Rises of each case."""
    motion: str = "supine_roll_over"
    """A motion's name in the robot's database, or an .npz file."""

    def run(self) -> int:
        """Run the benchmark; 1 when something was not safe."""
        world = self.load_stage()
        motion = find_motion(world.robot, self.motion)
        with counting("cases", len(CASES)) as count:
            result = bench_faults(
                world, motion, seed=self.seed, each=self.n, report=lambda _: count(1)
            )
        self.hand_over(result, FAULT_FIGURES)
        return judge_safety(result)


@dataclass(frozen=True, kw_only=True)
class BenchKill(BenchOptions):
    """Kill the program (SIGKILL) in the middle of a rise, and see when the servos stop."""

    n: int = 20
    """Kills."""
    motion: str = "supine_roll_over"
    """A motion's name in the robot's database, or an .npz file."""

    def run(self) -> int:
        """Run the benchmark; 1 when something was not safe."""
        world = self.load_stage()
        motion = find_motion(world.robot, self.motion)
        with counting("kills", self.n) as count:
            result = bench_kill(
                world, motion, seed=self.seed, each=self.n, report=lambda _: count(1)
            )
        self.hand_over(result, FAULT_FIGURES)
        return judge_safety(result)


def judge_safety(result: dict[str, Any]) -> int:
    """Return 1 when a limit was passed, a wrong position believed or a robot never safe."""
    harms = ("beyond_limits", "believed_wrong", "never_safe")
    harmed = any(case[harm] for case in result["cases"].values() for harm in harms)
    return DID_NOT_STAND if harmed else DID_IT


@dataclass(frozen=True, kw_only=True)
class BenchSoak(BenchOptions):
    """Rise, sit, tumble and rise again on the virtual bus, for as long as it takes."""

    duration: Annotated[float, arg(metavar="S")] = 1800.0
    """Time on the bus [s]."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        if not 0.0 < self.duration <= 1e6:
            faults.append(f"duration is {self.duration:g} s, allowed above 0 s, at most 1e6 s")
        return faults

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
        columns = (TextColumn("bus time"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True)) as progress:
            bar = progress.add_task("bus time", total=self.duration)
            result = bench_soak(
                world.robot,
                world.scene,
                seed=self.seed,
                duration=self.duration,
                report=lambda passed: progress.update(bar, completed=passed),
            )
        self.hand_over(result, SOAK_FIGURES)
        return DID_IT


FIGURES = (
    "n",
    "stood",
    "stand_time_s",
    "peak_torque_nm",
    "rms_torque_nm",
    "head_impact_m_s",
    "hottest_after_ten_rises_c",
)


@dataclass(frozen=True, kw_only=True)
class BenchMethods(BenchOptions):
    """Get up from the same falls by plans and by policies: success, time, load, impact, heat."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    ways: tuple[str, ...] = (PLAN, "robust")
    """What to compare: plan, and policies by name or file."""
    torque_limit: Annotated[float | None, arg(metavar="N·m")] = None
    """Cap on every servo [N·m]; without it, what the servos can."""
    pwm_limited: bool = False
    """Let the cap be a PWM limit, as servos in position mode have it."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        return super().find_faults() + find_torque_faults(self.torque_limit)

    def run(self) -> int:
        """Run the benchmark."""
        world = self.load_stage()
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
        return self.hand_over(result, FIGURES)

    def _make_strategy(self, world: World, name: str, limit: TorqueLimit) -> Strategy:
        if name != PLAN:
            return LearnedRise(load_policy(world.robot, name, self.torque_limit), name)
        with refusing():
            database = load_database(world.robot)
        return PlannedRise(world, database, RiseOptions(torque_limit=limit))
