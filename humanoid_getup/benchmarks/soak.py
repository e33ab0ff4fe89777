"""The soak test: rise, hold, lie down, tumble and rise again on the virtual bus, for hours."""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import msgspec
import numpy as np

from drivers import Command, SafetyGuard, State, run
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.lock_step import QUIET
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.benchmarks.bench_result import CaseBench
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.starts.falls import sample_falls
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot
from robots.quaternion import Array

STAND_TIME = 2.0  # s that the stand is held after it is judged
TUMBLE_TIME, TUMBLE_HOLD = 0.8, 0.4  # s
MEGABYTE = 2**20


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

    def __init__(self, robot: Robot, goal: Array, duration: float, hold: float) -> None:
        """Prepare to move to a goal (n,) [rad] in ``duration``, and to ``hold`` it [s]."""
        self._robot, self._goal = robot, goal
        self._duration, self._hold = duration, hold
        self._begin = self._now = 0.0
        self._from = goal

    @property
    def done(self) -> bool:
        """Return whether movement and hold are over."""
        return self._now - self._begin >= self._duration + self._hold - 1e-9

    def reset(self, state: State) -> None:
        """Start at the measured angles."""
        self._begin = self._now = state.time
        self._from = state.joint_pos

    def step(self, state: State) -> Command:
        """Interpolate between the measured start and the goal."""
        self._now = state.time
        share = min((self._now - self._begin) / self._duration, 1.0)
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


class SoakSummary(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of rises and bus traffic, and the growth of memory."""

    n: int
    bus_s: float
    wall_s: float
    faster_than_real_time: float
    stood: int
    stood_interval_95: tuple[float, float]
    attempts: int
    lay_down: int
    failures: list[str]
    cycles: int
    unexplained_s: float
    packets: int
    unanswered: int
    driver_lost: int
    driver_damaged: int
    driver_stale: int
    oldest_value_s: float
    holds: int
    clips: int
    eeprom_writes: int
    memory_mib: tuple[float, float]
    memory_mib_per_hour: float


def bench_soak(
    planner: PlannedRise,
    *,
    seed: int,
    duration: float,
    report: Callable[[float], None] = lambda _: None,
) -> CaseBench[SoakSummary]:
    """Rise, hold, lie down, tumble and rise again on a virtual bus in lock-step.

    Args:
        planner: Plans the rises.
        seed: Seed of the first fall, the tumbles and the plans.
        duration: Time on the bus [s].
        report: Called after each round with the bus time that it took [s].
    """
    world = planner.world
    rng = np.random.default_rng(seed)
    virtual = VirtualRobot(Simulation(world), powered=True)
    counts, began = SoakCounts(), time.perf_counter()
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        options = DriverOptions(make_port=ports.make_port)
        driver = CountingBackend(world.robot, ports.paths, clock=CycleClock(), options=options)
        guard = SafetyGuard(driver)
        start = sample_falls(world, {"supine": 1}, rng)[0].posture
        ports.main.call(lambda: virtual.place(start))
        now = time_before = ports.main.time
        while now - time_before < duration:
            _go_round(planner, virtual, guard, counts, rng)
            gc.collect()
            counts.memory.append(_resident_memory())
            before, now = now, ports.main.time
            report(now - before)
        line, passed = ports.main.statistics, ports.main.time - time_before
    wall = time.perf_counter() - began
    explained = driver.writes * driver.period + line.unanswered * QUIET
    settled = counts.memory[len(counts.memory) // 5 :]  # caches fill in the first rounds
    soak = SoakSummary(
        n=counts.rises,
        bus_s=passed,
        wall_s=wall,
        faster_than_real_time=passed / wall,
        stood=counts.stood,
        stood_interval_95=wilson_interval(counts.stood, counts.rises),
        attempts=counts.attempts,
        lay_down=counts.lay_down,
        failures=counts.reasons,
        cycles=driver.writes,
        unexplained_s=passed - explained,
        packets=line.packets,
        unanswered=line.unanswered,
        driver_lost=driver.statistics["main"].lost,
        driver_damaged=driver.statistics["main"].damaged,
        driver_stale=driver.statistics["main"].stale,
        oldest_value_s=driver.oldest,
        holds=counts.holds,
        clips=counts.clips,
        eeprom_writes=driver.eeprom_writes,
        memory_mib=(settled[0], settled[-1]),
        memory_mib_per_hour=_slope(settled) * 3600.0 * len(settled) / passed,
    )
    return CaseBench(name="soak", seed=seed, n=counts.rises, cases={"soak": soak})


def _go_round(
    planner: PlannedRise,
    virtual: VirtualRobot,
    guard: SafetyGuard,
    counts: SoakCounts,
    rng: np.random.Generator,
) -> None:
    """Rise, hold the stand and lie down from it, then tumble."""
    robot = planner.world.robot
    cycles = count(1)
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
    anywhere = rng.uniform(robot.lower, robot.upper)
    run(Interpolation(robot, anywhere, TUMBLE_TIME, TUMBLE_HOLD), guard, max_time=10.0)


def _resident_memory() -> float:
    """Return this process' resident memory [MiB], from /proc."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE


def _slope(values: list[float]) -> float:
    """Fit a line; return its rise from one value to the next."""
    if len(values) < 2:
        return 0.0
    return float(np.polyfit(np.arange(len(values)), values, 1)[0])
