"""`getup bench NAME`: measure on the twin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from rich.console import Console
from rich.table import Table
from tyro.conf import arg

from humanoid_getup.bench.motions import bench_motions
from humanoid_getup.bench.rise import CLASSES, bench_rise
from humanoid_getup.bench.speed import bench_filter
from humanoid_getup.cli import DID_IT
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import StageOptions, find_torque_faults
from humanoid_getup.commands.outputs import console_for, write_json
from humanoid_getup.commands.tables import counting, format_figure
from humanoid_getup.database import MOTION_FOLDER, load_database
from humanoid_getup.report import to_json
from humanoid_getup.rise_plan import RiseOptions
from humanoid_getup.stage import Stage

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
class BenchOptions(StageOptions):
    """What every benchmark is told."""

    n: int = 1

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        return faults if self.n >= 1 else [*faults, f"n is {self.n}, allowed 1 or more"]

    def load_stage(self) -> Stage:
        """Check the options, load the robot, and see that its motions can be loaded."""
        stage = super().load_stage()
        with refusing():
            load_database(stage.robot)
        return stage

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
        stage = self.load_stage()
        options = RiseOptions(
            planning=self.planning,
            filtering=self.filtering,
            assistance=self.assistance,
            torque_limit=self.torque_limit,
            pwm_limited=self.pwm_limited,
        )
        with counting("rises", len(CLASSES) * self.n) as count:
            robot, scene = stage.robot, stage.scene
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
        stage = self.load_stage()
        motions = len(list((stage.robot.folder / MOTION_FOLDER).glob("*.npz")))
        with counting("motions", motions) as count:
            robot, scene = stage.robot, stage.scene
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
        stage = self.load_stage()
        with Console(stderr=True).status("filtering"):
            result = bench_filter(stage.robot, stage.scene, seed=self.seed, repeats=self.n)
        return self.hand_over(result, SPEED_FIGURES)
