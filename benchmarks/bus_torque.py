"""Measure the motors' torque in planned rises over the virtual servo bus, in lock-step.

Each rise goes through driver, packets and simulated servos; the torque is that of the simulated
motors, every physics sample that the judge takes. A motor that drives its joint must not exceed
the torque limit; what a joint is driven by from outside is counted apart.

    python benchmarks/bus_torque.py --n 20 --seed 0 --torque-limit 2.5 --json bus_torque.json
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from script import counting

from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.benchmarks.rise import BENCH_CLASSES
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.rise import RiseFigures
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import Fall, sample_falls
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import TorqueLimit, load_robot
from robots.servo import LimitMode
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure the motors' torque in planned rises over the virtual servo bus."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    seed: int = 0
    torque_limit: float = 2.5
    """Of every servo [N·m]."""
    limit_by: LimitMode | None = None
    """What the limit acts on; none for the robot's own."""
    robot: str = "op3"
    json: Path | None = None
    """Where figures are written."""


def rise(strategy: PlannedRise, fall: Fall, seed: list[int]) -> RiseFigures:
    """Get a robot up over the bus; return the figures of the rise."""
    world = strategy.world
    virtual = VirtualRobot(Simulation(world))
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as served:
        served.main.call(lambda: virtual.place(fall.posture))
        driver = DynamixelBackend(
            world.robot,
            served.paths,
            clock=CycleClock(),
            limit_by=strategy.torque_limit.mode,
            options=DriverOptions(make_port=served.make_port),
        )
        with driver:  # switches servo power on
            pass
        options = SessionOptions(simulation=virtual.simulation)
        rng = np.random.default_rng(seed)
        result = get_up(driver, strategy, seed=rng, max_attempts=1, options=options)
    return result.figures()


def measure(options: Options, report: Callable[[int], None]) -> dict[str, Any]:
    """Rise from every fall."""
    world = World(load_robot(options.robot))
    limit = TorqueLimit(options.torque_limit, options.limit_by).on(world.robot)
    strategy = PlannedRise(world, settings=PlannerSettings(torque_limit=limit))
    counts: dict[str, int] = dict.fromkeys(BENCH_CLASSES, options.n)
    rises = []
    for number, fall in enumerate(sample_falls(world, counts, np.random.default_rng(options.seed))):
        rises.append(rise(strategy, fall, [options.seed, 1, number]))
        report(1)
    played = [r for r in rises if r.peak_torque_nm is not None]
    return {
        "name": "bus_torque",
        "seed": options.seed,
        "n": len(rises),
        "torque_limit_nm": limit.value,
        "limit_by": limit.by,
        "stood": sum(bool(r.stood) for r in rises),
        "played": len(played),
        "peak_torque_nm": max((r.peak_torque_nm or 0.0 for r in played), default=0.0),
        "peak_braking_torque_nm": max(
            (r.peak_braking_torque_nm or 0.0 for r in played), default=0.0
        ),
        "rises": rises,
    }


def main(options: Options) -> None:
    """Measure, print, write."""
    with counting("rises", options.n * len(BENCH_CLASSES)) as count:
        result = measure(options, count)
    limit, peak = result["torque_limit_nm"], result["peak_torque_nm"]
    Console().print(
        f"{result['stood']} of {result['n']} stood; a driving motor has {peak:.3f} N·m at most, "
        f"{peak / limit:.1%} of the limit; braking {result['peak_braking_torque_nm']:.2f} N·m"
    )
    if options.json is not None:
        write_atomically(options.json, to_json(result))


if __name__ == "__main__":
    main(tyro.cli(Options))
