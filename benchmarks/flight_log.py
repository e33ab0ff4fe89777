"""Time that a flight log takes of a control cycle, with and without messages for other programs.

    python benchmarks/flight_log.py --seconds 8

The cycles are those of a robot that is held in its stance by the twin; both logs get the same.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import tyro

from drivers import Command, Cycle, SafetyGuard, State, Twin, run
from drivers.flight_log.foxglove import FoxgloveMessages
from drivers.flight_log.writer import FlightLog
from robots import Robot, load_robot


@dataclass(frozen=True)
class Options:
    """Options of the benchmark."""

    robot: str = "op3"
    seconds: float = 8.0
    """Duration of the flight [s]."""


class Hold:
    """Holds the stance."""

    done = False

    def __init__(self, robot: Robot) -> None:
        self._command = Command.position(robot, robot.standing.joint_pos)

    def reset(self, state: State) -> None:
        """Start over."""

    def step(self, state: State) -> Command:
        """Return the command of every cycle."""
        del state
        return self._command


class NoMessages(FoxgloveMessages):
    """Messages of a log without those for other programs."""

    def describe(self, cycle: Cycle, time_ns: int):
        """Yield none."""
        del cycle, time_ns
        return iter(())


def record_cycles(robot: Robot, seconds: float) -> list[Cycle]:
    """Record the cycles of a robot that stands."""
    cycles: list[Cycle] = []
    run(Hold(robot), SafetyGuard(Twin(robot)), max_time=seconds, on_cycle=cycles.append)
    return cycles


def time_log(robot: Robot, cycles: Sequence[Cycle], file: Path, messages: FoxgloveMessages) -> dict:
    """Log cycles as fast as possible; return times of a cycle [ms] and the size [MB]."""
    spent = []
    log = FlightLog(file, robot)
    log._foxglove = messages
    with log:
        for cycle in cycles:
            began = time.perf_counter()
            log.log(cycle)
            spent.append(1e3 * (time.perf_counter() - began))
    median, p99 = np.percentile(spent, (50, 99))
    return {
        "median_ms": round(float(median), 3),
        "mean_ms": round(math.fsum(spent) / len(spent), 3),
        "p99_ms": round(float(p99), 3),
        "size_mb": round(file.stat().st_size / 1e6, 2),
    }


def main(options: Options) -> None:
    """Measure both logs, and print them as JSON."""
    robot = load_robot(options.robot)
    cycles = record_cycles(robot, options.seconds)
    with TemporaryDirectory() as folder:
        kinds = {"without": NoMessages(robot), "with": FoxgloveMessages(robot)}
        figures = {
            name: time_log(robot, cycles, Path(folder) / f"{name}.mcap", messages)
            for name, messages in kinds.items()
        }
    print(json.dumps({"cycles": len(cycles)} | figures, indent=1))


if __name__ == "__main__":
    main(tyro.cli(Options))
