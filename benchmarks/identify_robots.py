"""Identify robots that were altered in secret, from a rise each, and check them on another rise.

Strength 0.85 to 1, friction 0.7 to 1.6, mass 0.97 to 1.06, delay 0 to 12 ms, center of mass 6 mm to
either side, uniform; with `--load` also friction by load of 0.05 to 0.25. Robot 0 is not altered.

    python benchmarks/identify_robots.py --n 6 --json robots.json
"""

from __future__ import annotations

import copy
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import tyro
from script import Options, counting, write_results

from drivers import Command, SafetyGuard, Twin, run
from drivers.flight_log.reader import FlightRecord
from drivers.flight_log.writer import FlightLog
from drivers.twin.simulation import Simulation
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.simulation.world import World
from robots.torque_limit import Drive
from sim2real.identification.flight_fit import LENGTH, Excerpt, identify

FITTED, HELD_OUT = "supine_sit_up_fast", "prone_push_up_fast"
LOWER = {"strength": 0.85, "friction": 0.7, "mass": 0.97, "delay": 0.0, "com": -0.006}
UPPER = {"strength": 1.0, "friction": 1.6, "mass": 1.06, "delay": 0.012, "com": 0.006}
UNALTERED = {"strength": 1.0, "friction": 1.0, "mass": 1.0, "delay": 0.0, "com": 0.0}
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
    *("covered", "open", "cpu_s"),
)


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions(Options):
    """Options of this script."""

    n: int = 6
    """Altered robots."""
    load: bool = False
    """Whether they have friction by load, too."""


class AlteredTwin(Twin):
    """A robot that differs from its description."""

    def __init__(self, world: World, truth: dict[str, float]) -> None:
        """Alter a robot; its targets arrive late, between two physics steps if need be."""
        robot = world.robot
        joints = []
        for joint in robot.joints:
            own, load = joint.servo.model, truth.get("load_friction", 0.0)
            motor = replace(own, friction=own.friction * truth["friction"], load_friction=load)
            joints.append(replace(joint, servo=replace(joint.servo, model=motor)))
        robot = replace(robot, joints=tuple(joints))
        model = copy.copy(World(robot, world.scene).model)
        model.body_mass *= truth["mass"]
        model.body_inertia *= truth["mass"]
        model.body_ipos[model.body(robot.torso).id, 0] += truth["com"]
        mujoco.mj_setConst(model, mujoco.MjData(model))
        super().__init__(World(robot, world.scene, model=model))
        self._strength = truth["strength"]
        self._servos = np.array([model.actuator(name).id for name in robot.joint_names])
        self._delay = truth["delay"] / model.opt.timestep
        self._targets: list[np.ndarray] = []
        self._goal = np.zeros(robot.n)
        self.simulation.step = self._step_late

    def write(self, command: Command) -> Command:
        """Hold a command for one period, once it arrives."""
        self._targets = self._targets or [self.data.ctrl[self._servos].copy()]
        goal = self._units.round_goal(command.joint_pos)
        self._goal = self.robot.transmission.to_actuator(goal)
        return super().write(command)

    def _limit_servos(self, command: Command) -> Drive:
        drive, strength = super()._limit_servos(command), self._strength
        return replace(
            drive,
            torque=drive.torque * strength,
            pwm=np.where(drive.by_current, drive.pwm, drive.pwm * strength),
            gain_scale=drive.gain_scale * strength,
        )

    def _step_late(self, steps: int) -> None:
        for _ in range(steps):
            self._targets.append(self._goal)
            due = max(len(self._targets) - 1 - self._delay, 0.0)
            last = int(due)
            after = min(last + 1, len(self._targets) - 1)
            share = due - last
            late = (1.0 - share) * self._targets[last] + share * self._targets[after]
            self.data.ctrl[self._servos] = late
            Simulation.step(self.simulation, 1)


def main(options: IdentifyOptions) -> None:
    """Identify every robot, and write the figures."""
    world, cases = options.load_world(), dict[str, dict[str, Any]]()
    with counting("robots", options.n + 1) as count:
        for number in range(options.n + 1):
            rng = np.random.default_rng([options.seed, number])
            truth = {name: rng.uniform(LOWER[name], UPPER[name]) for name in LOWER}
            truth |= {"load_friction": rng.uniform(0.05, 0.25)} if options.load else {}
            cases[f"robot {number}"] = measure(world, truth if number else UNALTERED)
            count(1)
    write_results(options.describe("identify", options.n) | {"cases": cases}, FIGURES, options.json)


def measure(world: World, truth: dict[str, float]) -> dict[str, Any]:
    """Fly two rises of an altered robot, identify it from one, and compare."""
    fitted, held_out = (fly(world, truth, motion) for motion in (FITTED, HELD_OUT))
    began = time.process_time()
    fit = identify(world, [fitted], [held_out])
    spent = time.process_time() - began
    found = {"load_friction": 0.0} | fit.parameters
    true = {"load_friction": 0.0} | truth
    off = {key: scale * (found[name] - true[name]) for name, (key, scale) in ERRORS.items()}
    covered = sum(
        lower <= truth.get(n, 0.0) <= upper for n, (lower, upper) in fit.intervals.items()
    )
    return off | {
        "truth": truth,
        "fit": fit,
        "fitted_mrad": fit.fitted_gap_mrad,
        "catalog_mrad": fit.catalog_gap_mrad,
        "held_out_mrad": fit.gap_mrad,
        "closed_%": 100.0 * (1.0 - fit.gap_mrad / fit.catalog_gap_mrad),
        "covered": f"{covered} of {len(fit.intervals)}",
        "open": ", ".join(fit.not_identified),
        "cpu_s": spent,
    }


def fly(world: World, truth: dict[str, float], name: str) -> Excerpt:
    """Let a robot rise by a motion, open loop, and return the flight."""
    motion = next(m for m in load_database(world.robot).motions if m.name == name)
    start = find_rest(world, motion.posture(0))
    twin = AlteredTwin(world, truth)
    twin.place(start)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.mcap"
        player = MotionPlayer(world.robot, motion, hold=0.0)
        with FlightLog(path, world.robot, start=start) as log:
            run(player, SafetyGuard(twin), max_time=LENGTH + 0.1, on_cycle=log.log)
        return Excerpt.of(FlightRecord.load(path), world)


if __name__ == "__main__":
    main(tyro.cli(IdentifyOptions, description=__doc__))
