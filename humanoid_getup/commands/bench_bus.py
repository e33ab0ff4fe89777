"""`getup bench faults`, `kill` and `soak`: measure on the virtual bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from tyro.conf import arg

from humanoid_getup.bench.faults import CASES, bench_faults
from humanoid_getup.bench.kill import bench_kill
from humanoid_getup.bench.soak import bench_soak
from humanoid_getup.cli import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.bench import BenchOptions
from humanoid_getup.commands.play import find_motion
from humanoid_getup.commands.tables import counting

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
        stage = self.load_stage()
        motion = find_motion(stage.robot, self.motion)
        with counting("cases", len(CASES)) as count:
            result = bench_faults(
                stage, motion, seed=self.seed, each=self.n, report=lambda _: count(1)
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
        stage = self.load_stage()
        motion = find_motion(stage.robot, self.motion)
        with counting("kills", self.n) as count:
            result = bench_kill(
                stage, motion, seed=self.seed, each=self.n, report=lambda _: count(1)
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
        stage = self.load_stage()
        columns = (TextColumn("bus time"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True)) as progress:
            bar = progress.add_task("bus time", total=self.duration)
            result = bench_soak(
                stage.robot,
                stage.scene,
                seed=self.seed,
                duration=self.duration,
                report=lambda passed: progress.update(bar, completed=passed),
            )
        self.hand_over(result, SOAK_FIGURES)
        return DID_IT
