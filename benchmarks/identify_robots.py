"""Identify robots that were altered in secret, from a rise each, and check them on another rise.

Strength 0.85 to 1, friction 0.7 to 1.6, mass 0.97 to 1.06, delay 0 to 12 ms, center of mass 6 mm to
either side, uniform; with `--load` also friction by load of 0.05 to 0.25. Robot 0 is not altered.

    python benchmarks/identify_robots.py --n 6 --json robots.json
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from scipy.spatial.transform import Rotation
from script import Options, counting, write_results

from drivers import SafetyGuard, run
from drivers.flight_log.reader import FlightRecord
from drivers.flight_log.writer import FlightLog
from humanoid_getup.commands.backends import open_backend
from humanoid_getup.commands.options import BackendOptions
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.individual import AS_DESCRIBED, Individual
from sim2real.identification.flight_fit import identify
from sim2real.identification.flight_replay import LENGTH, Excerpt

FITTED, HELD_OUT = "supine_sit_up_fast", "prone_push_up_fast"
LOWER = {"strength": 0.85, "friction": 0.7, "mass": 0.97, "delay": 0.0, "com": -0.006}
UPPER = {"strength": 1.0, "friction": 1.6, "mass": 1.06, "delay": 0.012, "com": 0.006}
TILT = np.radians(3.0)  # standard deviation of the IMU's mounting about each axis
ERRORS = {
    "strength": ("strength_off_%", 100.0),
    "friction": ("friction_off_%", 100.0),
    "mass": ("mass_off_%", 100.0),
    "delay": ("delay_off_ms", 1e3),
    "com": ("com_off_mm", 1e3),
    "load_friction": ("load_off", 1.0),
}
FIGURES = (
    *("fitted_mrad", "catalog_mrad", "held_out_mrad", "closed_%"),
    *(name for name, _ in ERRORS.values()),
    "tilt_off_deg",
    *("covered", "open", "cpu_s"),
)


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(Options):
    """Options of this script."""

    n: int = 6
    """Altered robots."""
    load: bool = False
    """Whether they have friction by load, too."""
    bus: bool = False
    """Whether they are behind a virtual bus."""


def main(options: IdentifyOptions) -> None:
    """Identify every robot, and write the figures."""
    world, cases = options.load_world(), dict[str, dict[str, Any]]()
    with counting("robots", options.n + 1) as count:
        for number in range(options.n + 1):
            rng = np.random.default_rng([options.seed, number])
            figures: dict[str, Any] = {
                name: rng.uniform(LOWER[name], UPPER[name]) for name in LOWER
            }
            figures |= {"load_friction": rng.uniform(0.05, 0.25)} if options.load else {}
            truth = Individual(**figures, imu_tilt=tuple(rng.normal(0.0, TILT, 3).tolist()))
            cases[f"robot {number}"] = measure(
                world, truth if number else AS_DESCRIBED, options.bus
            )
            count(1)
    write_results(options.describe("identify", options.n) | {"cases": cases}, FIGURES, options.json)


def measure(world: World, truth: Individual, bus: bool) -> dict[str, Any]:
    """Fly two rises of an altered robot, identify it from one, and compare."""
    fitted, held_out = (fly(world, truth, motion, bus) for motion in (FITTED, HELD_OUT))
    began = time.process_time()
    fit = identify(world, [fitted], [held_out])
    spent = time.process_time() - began
    found = fit.individual
    off = {
        key: scale * (getattr(found, name) - getattr(truth, name))
        for name, (key, scale) in ERRORS.items()
    }
    tilts = (Rotation.from_rotvec(each.imu_tilt) for each in (found, truth))
    off["tilt_off_deg"] = np.degrees((next(tilts).inv() * next(tilts)).magnitude())
    intervals = found.intervals.items()
    covered = sum(lower <= getattr(truth, n) <= upper for n, (lower, upper) in intervals)
    return off | {
        "truth": truth,
        "fit": fit,
        "fitted_mrad": fit.fitted_gap_mrad,
        "catalog_mrad": fit.catalog_gap_mrad,
        "held_out_mrad": fit.gap_mrad,
        "closed_%": 100.0 * (1.0 - fit.gap_mrad / fit.catalog_gap_mrad),
        "covered": f"{covered} of {len(intervals)}",
        "open": ", ".join(fit.not_identified),
        "cpu_s": spent,
    }


def fly(world: World, truth: Individual, name: str, bus: bool = False) -> Excerpt:
    """Let a robot rise by a motion, open loop, and return the flight.

    It is a twin, or it is behind a virtual bus.
    """
    motion = next(m for m in load_database(world.robot).motions if m.name == name)
    start = find_rest(world, motion.posture(0))
    true = World(world.robot.with_individual(truth), world.scene)
    request = BackendOptions(robot=str(true.robot.folder), backend="virtual" if bus else "twin")
    with (
        tempfile.TemporaryDirectory() as folder,
        open_backend(request, true, TorqueLimit().on(true.robot)) as opened,
    ):
        assert opened.place is not None
        opened.place(start)
        path = Path(folder) / "flight.mcap"
        player = MotionPlayer(world.robot, motion, hold=0.0)
        with FlightLog(path, world.robot, start=start) as log:
            run(player, SafetyGuard(opened.backend), max_time=LENGTH + 0.1, on_cycle=log.log)
        return Excerpt.of(FlightRecord.load(path), world)


if __name__ == "__main__":
    main(tyro.cli(IdentifyOptions, description=__doc__))
