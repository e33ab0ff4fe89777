"""Rise, hold, lie down, tumble and rise again on the virtual bus in lock-step, for hours.

Rises are planned and supervised; a stand is held for 2 s before the robot sits and lies down; then
all joints go anywhere, and it falls.

    python benchmarks/soak.py --duration 1800 --json soak.json
"""

from __future__ import annotations

import gc
import os
import time
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from script import Options, counting, write_results

from drivers import Command, SafetyGuard, State, run
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.lock_step import QUIET
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot
from robots.quaternion import Array

STAND_TIME = 2.0  # s that the stand is held after it is judged
TUMBLE_TIME, TUMBLE_HOLD = 0.8, 0.4  # s
MEGABYTE = 2**20
FIGURES = ("n", "stood", "lay_down", "faster_than_real_time", "unexplained_s", "memory_mib")


@dataclass(frozen=True, kw_only=True)
class SoakOptions(Options):
    """Options of this script."""

    duration: float = 1800.0
    """Time on the bus [s]."""


class CountingBackend(DynamixelBackend):
    """A driver that counts its cycles and records the age of the oldest value."""

    writes = 0
    oldest = 0.0
    """Age of the oldest value in any measurement [s]."""

    def read(self) -> State:
        """Measure."""
        state = super().read()
        self.oldest = max(self.oldest, state.age)
        return state

    def write(self, command: Command) -> Command:
        """Send a command, and count it."""
        self.writes += 1
        return super().write(command)


class Interpolation:
    """A controller that moves all joints to goal angles at constant speed, then holds."""

    def __init__(self, robot: Robot, goal: Array) -> None:
        """Prepare to move to a goal (n,) [rad]."""
        self._robot, self._goal, self._from = robot, goal, goal
        self._begin = self._now = 0.0

    @property
    def done(self) -> bool:
        """Return whether movement and hold are over."""
        return self._now - self._begin >= TUMBLE_TIME + TUMBLE_HOLD - 1e-9

    def reset(self, state: State) -> None:
        """Start at the measured angles."""
        self._begin = self._now = state.time
        self._from = state.joint_pos

    def step(self, state: State) -> Command:
        """Interpolate between the measured start and the goal."""
        self._now = state.time
        share = min((self._now - self._begin) / TUMBLE_TIME, 1.0)
        return Command.position(self._robot, self._from + share * (self._goal - self._from))


@dataclass
class SoakCounts:
    """Counts of the soak so far."""

    rises: int = 0
    stood: int = 0
    attempts: int = 0
    lay_down: int = 0
    """Stands that were held and ended with the robot lying down softly."""
    holds: int = 0
    clips: int = 0
    reasons: list[str] = field(default_factory=list)
    memory: list[float] = field(default_factory=list)
    """Resident memory after each round [MiB]."""


def main(options: SoakOptions) -> None:
    """Go round for the time on the bus; write the counts."""
    planner = PlannedRise(options.load_world())
    world, rng = planner.world, np.random.default_rng(options.seed)
    virtual = VirtualRobot(Simulation(world), powered=True)
    counts, began = SoakCounts(), time.perf_counter()
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        driver = CountingBackend(
            world.robot,
            ports.paths,
            clock=CycleClock(),
            options=DriverOptions(make_port=ports.make_port),
        )
        guard = SafetyGuard(driver)
        start = sample_falls(world, {"supine": 1}, rng)[0].posture
        ports.main.call(lambda: virtual.place(start))
        now = first = ports.main.time
        with counting("bus time [s]", options.duration) as advance:
            while now - first < options.duration:
                go_round(planner, virtual, guard, counts, rng)
                gc.collect()
                counts.memory.append(read_memory())
                before, now = now, ports.main.time
                advance(now - before)
        line, passed = ports.main.statistics, ports.main.time - first
    wall = time.perf_counter() - began
    explained = driver.writes * driver.period + line.unanswered * QUIET
    settled = counts.memory[len(counts.memory) // 5 :]  # caches fill in the first rounds
    case: dict[str, Any] = {
        "n": counts.rises,
        "bus_s": passed,
        "wall_s": wall,
        "faster_than_real_time": passed / wall,
        "stood": counts.stood,
        "stood_interval_95": wilson_interval(counts.stood, counts.rises),
        "attempts": counts.attempts,
        "lay_down": counts.lay_down,
        "failures": counts.reasons,
        "cycles": driver.writes,
        "unexplained_s": passed - explained,
        "packets": line.packets,
        "unanswered": line.unanswered,
        "driver_lost": driver.statistics["main"].lost,
        "driver_damaged": driver.statistics["main"].damaged,
        "driver_stale": driver.statistics["main"].stale,
        "oldest_value_s": driver.oldest,
        "holds": counts.holds,
        "clips": counts.clips,
        "eeprom_writes": driver.eeprom_writes,
        "memory_mib": (settled[0], settled[-1]),
        "memory_mib_per_hour": fit_slope(settled) * 3600.0 * len(settled) / passed,
    }
    result = options.describe("soak", counts.rises) | {"cases": {"soak": case}}
    write_results(result, FIGURES, options.json)


def go_round(
    planner: PlannedRise,
    virtual: VirtualRobot,
    guard: SafetyGuard,
    counts: SoakCounts,
    rng: np.random.Generator,
) -> None:
    """Rise, hold the stand and lie down from it, then tumble."""
    robot, cycles = planner.world.robot, count(1)
    options = SessionOptions(
        simulation=virtual.simulation,
        then="hold",
        is_released=lambda: next(cycles) * guard.period >= STAND_TIME,
    )
    rise = get_up(guard, planner, seed=rng, options=options)
    counts.rises += 1
    counts.stood += rise.stood
    counts.attempts += rise.times_played
    if not rise.stood:
        counts.reasons.append(rise.reason)
        guard.clear()
    after = rise.after
    if after is not None and after.succeeded:
        counts.lay_down += 1
    elif after is not None:
        counts.reasons.append(after.reason)
        guard.clear()
    # Both are counted from the connection before the rise to the end of what was played last.
    last = after.way_down.run if after is not None and after.way_down is not None else rise.run
    if last is not None:
        counts.holds += last.holds
        counts.clips += last.clips.total
    run(Interpolation(robot, rng.uniform(robot.lower, robot.upper)), guard, max_time=10.0)


def read_memory() -> float:
    """Return this process' resident memory [MiB], from /proc."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE


def fit_slope(values: list[float]) -> float:
    """Fit a line; return its rise from one value to the next."""
    return float(np.polyfit(np.arange(len(values)), values, 1)[0]) if len(values) > 1 else 0.0


if __name__ == "__main__":
    main(tyro.cli(SoakOptions, description=__doc__))
