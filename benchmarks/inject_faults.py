"""Inject faults of bus, servos, board and controller in the middle of a motion; exit 1 if unsafe.

The motion, or a held stand, is played on the virtual bus in lock-step, from its own start. Every
play is compared with its servos: values that the driver believes are fresh equal their encoders,
targets stay within the joint ranges, and after the fault torque is off or the servos hold.

    python benchmarks/inject_faults.py --n 20 --json faults.json
    python benchmarks/inject_faults.py --n 2 --motion standing --cases "servo dead" "bus silent"
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import tyro
from checked_driver import CheckedDriver
from fault_injector import FaultInjector, LineFault
from script import Options, do_pieces, write_results

from drivers import Command, Ending, GuardLimits, RunReport, SafetyGuard, State
from drivers.dynamixel.clock import CycleClock
from drivers.errors import UnreleasedError
from drivers.state import HardwareError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.experiments.judging.summary import summarize
from humanoid_getup.motions.motion import STANDING, Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.playback.play import MotionPlayer, hold_time
from humanoid_getup.playback.simulated_play import has_succeeded, play_in_simulation
from humanoid_getup.playback.supervisor import make_stand
from humanoid_getup.simulation.world import World

WINDOW = (0.1, 0.8)  # part of the motion, or of a held stand, in which the fault is injected
AFTERMATH = 0.5  # s of bus time observed after the run: longer than the servos' watchdog
DONE = Ending.DONE.name.lower()
FIGURES = ("n", "succeeded", "endings", "safe_max_s", "beyond_limits", "believed_wrong", "unsaid")
HARMS = ("beyond_limits", "believed_wrong", "never_safe", "unsaid")


@dataclass(frozen=True, kw_only=True)
class FaultOptions(Options):
    """Options of this script."""

    n: int = 20
    """Plays of each case."""
    motion: str = "supine_roll_over"
    """Name of a motion in the robot's database, an .npz file, or standing: a held stand."""
    cases: tuple[str, ...] = ()
    """Names of the faults; default: all."""


class FaultyError(Exception):
    """An injected bug of a controller."""


@dataclass(frozen=True)
class FaultTrial:
    """One play of a motion with an injected fault."""

    ending: str
    reason: str
    succeeded: bool
    """Whether it ended as its motion should in spite of the fault."""
    safe: float | None
    """Time from the fault until torque was off or the servos held [s]; None if that never
    happened, or if the motion continued."""
    beyond_limits: int
    believed_wrong: int
    holds: int
    """Cycles that the guard bridged by holding."""
    unsaid: int
    """Servos left with torque on that the driver did not name."""


@dataclass
class FaultTarget:
    """Interfaces for the injection of faults."""

    faults: FaultInjector
    guard: SafetyGuard
    servo: int
    """Id of a random servo."""
    board: int


@dataclass(frozen=True)
class FaultCase:
    """One kind of fault."""

    inject: Callable[[FaultTarget], object] = lambda _: None
    """Injects the fault, once."""
    corrupt: Callable[[Command], Command] = lambda command: command
    """Changes every command after the injection."""


def _raise(_command: Command) -> Command:
    raise FaultyError("a bug in the controller")


def _rate(fault: LineFault, rate: float) -> FaultCase:
    return FaultCase(lambda m: m.faults.set_rate(fault, rate))


def _once(fault: LineFault) -> FaultCase:
    return FaultCase(lambda m: m.faults.strike_next(fault, None, 1))


def _trip(error: HardwareError) -> FaultCase:
    return FaultCase(lambda m: m.faults.trip(m.servo, error))


def _everywhere(value: float) -> Callable[[Command], Command]:
    return lambda c: replace(c, joint_pos=np.full(c.n, value))


CASES: Mapping[str, FaultCase] = {
    "none": FaultCase(),
    "one reply lost": _once(LineFault.LOSE),
    "one reply damaged": _once(LineFault.FLIP),
    "one reply late": _once(LineFault.LATE),
    "one reply truncated": _once(LineFault.CUT),
    "one reply split": _once(LineFault.SPLIT),
    "one request lost": _once(LineFault.LOSE_REQUEST),
    "replies lost, 1 %": _rate(LineFault.LOSE, 0.01),
    "bits flipped, 1e-4 a byte": _rate(LineFault.FLIP, 1e-4),
    "bits flipped, 1e-3 a byte": _rate(LineFault.FLIP, 1e-3),
    "bits flipped, 1e-2 a byte": _rate(LineFault.FLIP, 1e-2),
    "requests flipped, 1e-3 a byte": _rate(LineFault.FLIP_REQUEST, 1e-3),
    "replies late, 1 %": _rate(LineFault.LATE, 0.01),
    "replies split, 10 %": _rate(LineFault.SPLIT, 0.1),
    "replies duplicated, 1 %": _rate(LineFault.DUPLICATE, 0.01),
    "noise before replies, 1 %": _rate(LineFault.NOISE, 0.01),
    "requests echoed": _rate(LineFault.ECHO, 1.0),
    "replies with a wrong id, 1 %": _rate(LineFault.WRONG_ID, 0.01),
    "servo dead": FaultCase(lambda m: m.faults.kill(m.servo)),
    "servo reboots": FaultCase(lambda m: m.faults.reboot(m.servo)),
    "overload latch": _trip(HardwareError.OVERLOAD),
    "overheating latch": _trip(HardwareError.OVERHEATING),
    "encoder error": _trip(HardwareError.ENCODER),
    "electrical shock": _trip(HardwareError.SHOCK),
    "servo at 78 °C": FaultCase(lambda m: m.faults.heat(m.servo, 78.0)),
    "servo at 85 °C": FaultCase(lambda m: m.faults.heat(m.servo, 85.0)),
    "supply drops to 9 V": FaultCase(lambda m: m.faults.sag(9.0)),
    "IMU frozen": FaultCase(lambda m: m.faults.freeze_imu()),
    "board dead": FaultCase(lambda m: m.faults.kill(m.board)),
    "bus silent": FaultCase(lambda m: m.faults.silence()),
    "unplugged": FaultCase(lambda m: m.faults.unplug()),
    "unplugged and plugged in again": FaultCase(lambda m: (m.faults.unplug(), m.faults.replug())),
    "command of NaN": FaultCase(corrupt=_everywhere(np.nan)),
    "command of 1e9 rad": FaultCase(corrupt=_everywhere(1e9)),
    "command a step of 1 rad": FaultCase(corrupt=lambda c: replace(c, joint_pos=c.joint_pos + 1.0)),
    "controller raises": FaultCase(corrupt=_raise),
    "stop key": FaultCase(lambda m: m.guard.stop("the operator pressed a key")),
}


class FaultyPlayer(MotionPlayer):
    """Plays a motion, and injects a fault once it is due."""

    def __init__(self, motion: Motion, case: FaultCase, target: FaultTarget, at: float) -> None:
        super().__init__(target.guard.robot, motion, hold=hold_time(motion))
        self._case, self._reached, self._due = case, target, at
        self.injected = False

    def step(self, state: State) -> Command:
        """Send the targets that are due; inject the fault when it is due."""
        command = super().step(state)
        if state.time - self._begin >= self._due and not self.injected:
            self._case.inject(self._reached)
            self.injected = True
        return self._case.corrupt(command) if self.injected else command


def main(options: FaultOptions) -> dict[str, Any]:
    """Play every case; write and return the figures."""
    cases = options.cases or tuple(CASES)
    pieces = [(case, number) for case in cases for number in range(options.n)]
    trials = do_pieces(partial(play_with_fault, options), pieces, options)
    table = {
        case: summarize_trials(trials[k * options.n : (k + 1) * options.n])
        for k, case in enumerate(cases)
    }
    result = options.describe("faults", options.n)
    result |= {"motion": load_played(options)[1].name, "cases": table}
    write_results(result, FIGURES, options.json)
    return result


@lru_cache(maxsize=1)
def load_played(options: FaultOptions) -> tuple[World, Motion]:
    """Load the world, and the motion that is played, or a stand."""
    world = options.load_world()
    if options.motion == STANDING:
        return world, make_stand(world.robot)
    return world, find_motion(world.robot, options.motion)


def play_with_fault(options: FaultOptions, piece: tuple[str, int]) -> FaultTrial:
    """Play the motion in lock-step, and inject the fault of a case at a random moment."""
    name, number = piece
    world, motion = load_played(options)
    robot, rng = world.robot, np.random.default_rng([options.seed, number])
    virtual = VirtualRobot(Simulation(world), powered=True)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        driver = CheckedDriver(virtual, ports, clock=CycleClock())
        with driver:
            pass  # the first connection configures the servos, which may take time
        start = find_rest(world, motion.posture(0))
        ports.main.call(lambda: virtual.place(start))
        guard = SafetyGuard(driver, GuardLimits.of(robot))
        at = (motion.duration or hold_time(motion)) * rng.uniform(*WINDOW)
        servo = robot.joints[int(rng.integers(robot.n))].servo
        board = robot.bus.board.id if robot.bus and robot.bus.board else 0
        faults = FaultInjector(ports.main, rng.spawn(1)[0])
        target = FaultTarget(faults, guard, servo.id, board)
        player = FaultyPlayer(motion, CASES[name], target, at)
        injected_at: list[float] = []

        def look(_cycle: object) -> None:
            if player.injected and not injected_at:
                injected_at.append(ports.main.time)

        try:
            report, outcome = play_in_simulation(
                player, guard, virtual.simulation, world.scene, on_cycle=look
            )
            succeeded = report.ending is Ending.DONE and bool(has_succeeded(motion, outcome))
        except (FaultyError, UnreleasedError) as error:
            report, succeeded = error, False
        since = injected_at[0] - robot.control_period if injected_at else ports.main.time
        ports.main.call(lambda: virtual.physics.advance(virtual.physics.time + AFTERMATH))
        driven = {j.name for j, s in zip(robot.joints, virtual.servos, strict=True) if s.torque_on}
    ending = "unreleased" if isinstance(report, UnreleasedError) else "raised"
    if isinstance(report, RunReport):
        ending = report.ending.name.lower()
    return FaultTrial(
        ending=ending,
        reason=report.reason if isinstance(report, RunReport) else str(report),
        succeeded=succeeded,
        safe=None if ending == DONE else driver.trace.find_safe_time(since),
        beyond_limits=driver.trace.count_beyond_limits() + driver.too_fast,
        believed_wrong=len(driver.believed_wrong),
        holds=guard.holds,
        unsaid=len(driven.difference(driver.unreleased)),
    )


def summarize_trials(trials: Sequence[FaultTrial]) -> dict[str, Any]:
    """Summarize how the plays of one case ended, and when the robot was safe."""
    sums = ("succeeded", "beyond_limits", "believed_wrong", "holds", "unsaid")
    return {
        "n": len(trials),
        "endings": Counter(trial.ending for trial in trials),
        "reasons": Counter(trial.reason.partition(":")[0] for trial in trials),
        **summarize_safe_times([trial.safe for trial in trials if trial.ending != DONE]),
        **{key: sum(getattr(trial, key) for trial in trials) for key in sums},
    }


def summarize_safe_times(times: Sequence[float | None]) -> dict[str, Any]:
    """Summarize the times until robots were safe [s]; None for never."""
    return {
        "safe_s": summarize(times),
        "safe_max_s": max((s for s in times if s is not None), default=None),
        "never_safe": sum(s is None for s in times),
    }


def is_harmed(result: Mapping[str, Any]) -> bool:
    """Tell whether a robot was unsafe, or a wrong position believed, in any case."""
    return any(case.get(harm, 0) for case in result["cases"].values() for harm in HARMS)


if __name__ == "__main__":
    raise SystemExit(is_harmed(main(tyro.cli(FaultOptions, description=__doc__))))
