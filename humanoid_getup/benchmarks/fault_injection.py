"""Fault injection: faults of bus, servos, board and controller in the middle of a motion."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Self, TypeAlias

import msgspec
import numpy as np

from drivers import Command, Ending, GuardLimits, RunReport, SafetyGuard, State
from drivers.dynamixel.clock import CycleClock
from drivers.errors import DriverError, UnreleasedError
from drivers.state import HardwareError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.own_process.real_time_robot import RealTimeRobot
from drivers.virtual_bus.serving.fault_injector import FaultInjector
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.serving.wire_faults import LineFault
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.benchmarks.bench_result import CaseBench
from humanoid_getup.benchmarks.checked_driver import CheckedDriver, ServoTrace
from humanoid_getup.benchmarks.pieces import RunPieces, collect, one_by_one
from humanoid_getup.experiments.judging.summary import Quantiles, summarize
from humanoid_getup.experiments.starts.falls import find_rest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.ending import has_succeeded, hold_time
from humanoid_getup.playback.motion_player import MotionPlayer
from humanoid_getup.playback.play import play_in_simulation
from humanoid_getup.simulation.world import World
from robots import Robot

WINDOW = (0.1, 0.8)  # part of the motion, or of a held stand, in which the fault is injected
AFTERMATH = 0.5  # s of bus time observed after the run: longer than the servos' watchdog


class FaultyError(Exception):
    """An injected bug of a controller."""


@dataclass(frozen=True)
class FaultTrial:
    """One run of a motion with an injected fault."""

    ending: str
    """How the run ended."""
    reason: str
    succeeded: bool
    """Whether it ended as its motion should in spite of the fault."""
    safe: float | None
    """Time from the fault until torque was off or the servos held [s]; ``None`` if that never
    happened, or if the motion continued."""
    beyond_limits: int
    believed_wrong: int
    holds: int
    """Cycles that the guard bridged by holding."""
    unsaid: int
    """Servos left with torque on that the driver did not name."""


class SafetySummary(msgspec.Struct, frozen=True, kw_only=True):
    """How runs with a fault ended, and when the robot was safe [s]."""

    n: int
    succeeded: int = 0
    endings: dict[str, int]
    safe_s: Quantiles
    safe_max_s: float | None
    never_safe: int
    beyond_limits: int
    believed_wrong: int = 0

    @classmethod
    def of(cls, safe: Sequence[float | None], **others: Any) -> Self:
        """Summarize the times until robots were safe; ``others`` are the other fields."""
        return cls(
            safe_s=summarize(safe),
            safe_max_s=max((s for s in safe if s is not None), default=None),
            never_safe=sum(s is None for s in safe),
            **others,
        )


class FaultSummary(SafetySummary, frozen=True, kw_only=True):
    """How runs with an injected fault ended."""

    reasons: dict[str, int]
    holds: int
    unsaid: int


class KillSummary(SafetySummary, frozen=True, kw_only=True):
    """How robots stopped after their program was killed."""

    tripped: int
    """Times that the bus watchdog of every servo had tripped."""


@dataclass(frozen=True, kw_only=True)
class KillTrial:
    """One client that was killed."""

    stop: float | None
    """Time from the kill until torque was off or the servos held [s]; ``None`` for never."""
    tripped: bool
    beyond_limits: int


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

    def __init__(
        self, robot: Robot, motion: Motion, case: FaultCase, target: FaultTarget, at: float
    ) -> None:
        super().__init__(robot, motion, hold=hold_time(motion))
        self._case, self._interfaces, self._due = case, target, at
        self.injected = False

    def step(self, state: State) -> Command:
        """Send the targets that are due; inject the fault when it is due."""
        command = super().step(state)
        if state.time - self._begin >= self._due and not self.injected:
            self._case.inject(self._interfaces)
            self.injected = True
        return self._case.corrupt(command) if self.injected else command


@dataclass(frozen=True, kw_only=True)
class FaultPiece:
    """One play of a motion, with the fault of a case."""

    case: str
    number: int
    seed: int


RunFaults: TypeAlias = RunPieces[FaultPiece, FaultTrial]


def bench_faults(
    world: World,
    motion: Motion,
    *,
    seed: int,
    each: int,
    cases: Sequence[str] = (),
    report: Callable[[FaultTrial], object] = lambda _: None,
    run: RunFaults | None = None,
) -> CaseBench[FaultSummary]:
    """Inject each fault several times during a motion on the virtual bus.

    Args:
        world: Robot and scene.
        motion: Motion to play, from its own start.
        seed: Of the times, the servos and the damage.
        each: Plays of each case.
        cases: Names of the faults; none for all.
        report: Called after each play.
        run: Does the plays; None: one after another, here.
    """
    cases = cases or tuple(CASES)
    pieces = {
        f"{case}: {k}": FaultPiece(case=case, number=k, seed=seed)
        for case in cases
        for k in range(each)
    }
    found = collect(pieces, run or one_by_one(partial(play_with_fault, world, motion)), report)
    table = {
        case: _summarize([found[key] for key, piece in pieces.items() if piece.case == case])
        for case in cases
    }
    return CaseBench(name="faults", seed=seed, n=each, motion=motion.name, cases=table)


def play_with_fault(world: World, motion: Motion, piece: FaultPiece) -> FaultTrial:
    """Play a motion on the virtual bus in lock-step, and inject a fault at a random moment."""
    robot, case, rng = (
        world.robot,
        CASES[piece.case],
        np.random.default_rng([piece.seed, piece.number]),
    )
    virtual = VirtualRobot(Simulation(world), powered=True)
    faulty = PortOptions(rng=rng)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP, options=faulty) as ports:
        driver = CheckedDriver(virtual, ports, clock=CycleClock())
        with driver:
            pass  # the first connection configures the servos, which may take time
        start = find_rest(world, motion.posture(0))
        ports.main.call(lambda: virtual.place(start))
        guard = SafetyGuard(driver, GuardLimits.of(robot))
        at = (motion.duration or hold_time(motion)) * rng.uniform(*WINDOW)
        servo = robot.joints[int(rng.integers(robot.n))].servo
        board = robot.bus.board if robot.bus else None
        target = FaultTarget(ports.main.faults, guard, servo.id, board.id if board else 0)
        player = FaultyPlayer(robot, motion, case, target, at)
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
    went_on = isinstance(report, RunReport) and report.ending is Ending.DONE
    return FaultTrial(
        ending=ending,
        reason=report.reason if isinstance(report, RunReport) else str(report),
        succeeded=succeeded,
        safe=None if went_on else driver.trace.find_safe_time(since),
        beyond_limits=driver.trace.count_beyond_limits() + driver.too_fast,
        believed_wrong=len(driver.believed_wrong),
        holds=guard.holds,
        unsaid=len(driven.difference(driver.unreleased)),
    )


def _summarize(trials: list[FaultTrial]) -> FaultSummary:
    reasons = Counter(trial.reason.partition(":")[0] for trial in trials)
    safe = [trial.safe for trial in trials if trial.ending != Ending.DONE.name.lower()]
    return FaultSummary.of(
        safe,
        n=len(trials),
        succeeded=sum(trial.succeeded for trial in trials),
        endings=dict(Counter(trial.ending for trial in trials)),
        reasons=dict(reasons),
        beyond_limits=sum(trial.beyond_limits for trial in trials),
        believed_wrong=sum(trial.believed_wrong for trial in trials),
        holds=sum(trial.holds for trial in trials),
        unsaid=sum(trial.unsaid for trial in trials),
    )


MAX_START_TIME = 30.0  # s until the client has switched torque on
KILL_WINDOW = (0.3, 0.8)  # part of the motion in which the client is killed
KILL_AFTERMATH = 0.6  # s observed after the kill
POLL = 0.01  # s between two checks for torque


def bench_kill(
    world: World,
    motion: Motion,
    *,
    seed: int,
    each: int,
    report: Callable[[KillTrial], None] = lambda _: None,
) -> CaseBench[KillSummary]:
    """Kill a client (SIGKILL) ``each`` times in the middle of a rise; time the stop.

    The client plays the motion, from its own start, on a real-time bus. ``seed`` is that of the
    times; ``report`` is called with the figures of each kill.
    """
    rng = np.random.default_rng(seed)
    trials: list[KillTrial] = []
    refused = 0
    while len(trials) < each:
        trial = _kill_once(world, motion, float(rng.uniform(*KILL_WINDOW)))
        if trial is not None:
            trials.append(trial)
            report(trial)
            continue
        refused += 1
        if refused > each:
            raise DriverError(
                f"the client did not switch its robot's torque on within {MAX_START_TIME:g} s, "
                f"{refused} times: expected a computer that has time for it"
            )
    case = KillSummary.of(
        [trial.stop for trial in trials],
        n=each,
        endings={"killed": each, "never began": refused},
        tripped=sum(trial.tripped for trial in trials),
        beyond_limits=sum(trial.beyond_limits for trial in trials),
    )
    return CaseBench(name="kill", seed=seed, n=each, cases={"client killed (SIGKILL)": case})


def _kill_once(world: World, motion: Motion, share: float) -> KillTrial | None:
    """Kill a client; ``None`` if it never started, as on an overloaded machine."""
    with RealTimeRobot(Simulation(world)) as served:
        served.place(find_rest(world, motion.posture(0)))
        trace = ServoTrace(served.physics)
        ports = ",".join(f"{name}={path}" for name, path in served.paths.items())
        command = [sys.executable, "-m", "humanoid_getup.cli.main", "play", motion.name]
        command += ["--robot", str(world.robot.folder)]
        command += ["--backend", "virtual", "--port", ports, "--then", "limp"]
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
        ) as client:
            if not _await_torque(served.simulation, client):
                return None
            time.sleep(motion.duration * share)
            killed = served.physics.time
            client.send_signal(signal.SIGKILL)
            time.sleep(KILL_AFTERMATH)
        tripped = all(value < 0 for value in served.peek("bus_watchdog"))
    return KillTrial(
        stop=trace.find_safe_time(killed),
        tripped=tripped,
        beyond_limits=trace.count_beyond_limits(),
    )


def _await_torque(simulation: Simulation, client: subprocess.Popen[bytes]) -> bool:
    until = time.monotonic() + MAX_START_TIME
    while not simulation.has_torque:
        if time.monotonic() > until or client.poll() is not None:
            client.kill()
            return False
        time.sleep(POLL)
    return True
