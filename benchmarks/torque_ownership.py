"""Torque in each phase of a rise after a stop, a silent servo, a pause, a dip and a dead program.

    python benchmarks/torque_ownership.py --n 20 --seed 0 --json torque.json
    python benchmarks/torque_ownership.py --n 0 --stops 200 --seed 1

An OP3 on the virtual bus in lock-step rises from a squat, or stands and is held, sits and lies
down, or is handed over. One event comes at a random cycle of one phase. Its servos are XM430s, or
have the registers of AX-12A or STS3215 with the motor of the XM430, since theirs do not carry it;
beside these it has no IMU, so that no way down begins. Every row says how the robots ended, the
time from the event (from the end of a pause) until torque was off or every servo held, and how many
servos had torque on that was not said: in no report, hand-over or error.

`--stops` places a stop at a random packet of whole sessions, from the first connection to the last
close: every one of them ends limp, unless the packet comes after the hand-over was confirmed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from json import dumps
from pathlib import Path

import numpy as np
import tyro
from checked_driver import CheckedDriver
from fault_injector import FaultInjector
from other_servos import use_servos

import humanoid_getup as hg
from drivers import Cycle, SafetyGuard
from drivers.dynamixel.clock import CycleClock
from drivers.errors import DriverError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.execution.after_stand import AfterStand
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import Phase, PhaseChange, SessionOptions
from humanoid_getup.experiments.falls import find_rest, settle_posture
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import read_posture

SERVOS = {"X": "", "AX": "AX-12A", "STS": "STS3215-C018"}
MOTION = "squat_to_stand"
PAUSE, DIP_TIME = 2.0, 0.5  # s
DIP, SAG = 0.97, 0.85  # of the least supply of the servos
HELD = 1.5  # s that a stand is held where nothing is judged
AFTERMATH = 0.5  # s observed after the end: longer than the servos' watchdog
PHASES = {
    "rise": Phase.PLAYING,
    "hold": Phase.HOLDING,
    "way down": Phase.LYING_DOWN,
    "hand-over": None,
}
EVENTS = ("stop", "silent servo", "pause", "dip", "low supply", "dead program")


class ProgramDiedError(BaseException):
    """The program is gone: nothing is sent any more."""


@dataclass(frozen=True)
class Bench:
    """A robot on a virtual bus, and what drives it."""

    virtual: VirtualRobot
    ports: VirtualPorts
    driver: CheckedDriver
    guard: SafetyGuard
    start: Posture

    def wait(self, seconds: float) -> None:
        """Let time pass in which nothing is sent."""
        physics = self.virtual.physics
        self.ports.main.call(lambda: physics.advance(physics.time + seconds))


@dataclass(frozen=True)
class Trial:
    """How a robot ended after an event."""

    end: str
    """Limp, held by its servos, or as without the event."""
    safe_s: float | None
    """Time from the event until torque was off or every servo held [s]; None if it went on."""
    unsaid: int
    """Servos with torque on that no report, hand-over or error names."""
    beyond_limits: int


def make_world(servos: str) -> World:
    """Load the OP3 with a kind of servos; without an IMU for those of other protocols."""
    op3 = hg.load_robot("op3")
    name = SERVOS[servos]
    if not name:
        return World(op3)
    assert op3.bus is not None
    other, motor = use_servos(op3, name), op3.joints[0].servo.model
    model = replace(
        other.joints[0].servo.model,
        stall_torque=motor.stall_torque,
        stall_current=motor.stall_current,
        no_load_speed=motor.no_load_speed,
        armature=motor.armature,
        friction=motor.friction,
        max_voltage=motor.max_voltage,
    )
    lower, upper = model.ends
    joints = tuple(
        replace(
            joint,
            lower=max(joint.lower, lower + 0.01),
            upper=min(joint.upper, upper - 0.01),
            servo=replace(joint.servo, model=model, zero_ticks=model.middle_tick),
        )
        for joint in other.joints
    )
    bus = replace(op3.bus, board=None, baud=1_000_000)
    return World(replace(other, joints=joints, bus=bus, imu_site=None))


@contextmanager
def open_bench(world: World) -> Iterator[Bench]:
    """Open a robot that squats on a virtual bus."""
    robot = world.robot
    virtual = VirtualRobot(Simulation(world), powered=True)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        without_imu = robot.imu_kind is None
        driver = CheckedDriver(virtual, ports, clock=CycleClock(), without_imu=without_imu)
        with driver:
            pass  # the first connection configures the servos, which may take time
        motion = hg.StoredMotion(world, MOTION).motion
        start = read_posture(robot, world.model, settle_posture(world, motion.posture(0)))
        ports.main.call(lambda: virtual.place(start))
        yield Bench(virtual, ports, driver, SafetyGuard(driver), start)


def run_session(
    bench: Bench,
    world: World,
    then: str,
    on_cycle: Callable[[Cycle], None] = lambda _: None,
    on_phase: Callable[[PhaseChange], None] = lambda _: None,
    *,
    rises: bool = True,
) -> Rise | AfterStand:
    """Get the robot up, or take over one that stands, and end its stand."""
    held = [0.0]

    def is_released() -> bool:
        held[0] += world.robot.control_period
        return held[0] > HELD

    options = SessionOptions(
        settle=False,
        preflight=False,
        assumed_start=bench.start if world.robot.imu_kind is None else None,
        simulation=bench.virtual.simulation,
        is_released=is_released,
        on_cycle=on_cycle,
        on_phase=on_phase,
        realtime=False,
    )
    if not rises:
        stand = find_rest(world, world.robot.standing)
        place = bench.ports.main.call
        options = replace(options, place=lambda: place(lambda: bench.virtual.place(stand)))
        return hg.keep_stand(bench.guard, world, then=then, options=options)  # type: ignore[arg-type]
    strategy = hg.StoredMotion(world, MOTION)
    return hg.get_up(bench.guard, strategy, max_attempts=1, then=then, options=options)  # type: ignore[arg-type]


def count_cycles(world: World, phase: str) -> int:
    """Count the cycles of a phase without an event."""
    counts, present = Counter[str](), [""]
    with open_bench(world) as bench:
        run_session(
            bench,
            world,
            choose_ending(world, phase),
            lambda _: counts.update([present[0]]),
            lambda change: present.__setitem__(0, change.phase.name),
            rises=rises(world, phase),
        )
    wanted = PHASES[phase]
    return counts[wanted.name] if wanted else 0


def rises(world: World, phase: str) -> bool:
    """Return whether a session begins with a rise; only an IMU tells that a robot stands."""
    return phase == "rise" or world.robot.imu_kind is None


def choose_ending(world: World, phase: str) -> str:
    """Choose what ends the stand, so that a phase is reached soon."""
    endings = {"rise": "limp", "hold": "limp", "way down": "sit", "hand-over": "hand-over"}
    return "hold" if phase == "hold" and world.robot.imu_kind is None else endings[phase]


def strike(bench: Bench, event: str, servo: int) -> Callable[[], None]:
    """Make what brings an event about."""
    faults = FaultInjector(bench.ports.main, np.random.default_rng(0))

    def pause() -> None:
        bench.wait(PAUSE)
        bench.driver._clock.pass_period(PAUSE)

    def die() -> None:
        bench.driver.close = lambda: None  # type: ignore[method-assign]
        raise ProgramDiedError

    return {
        "stop": lambda: bench.guard.stop("a key was pressed"),
        "silent servo": lambda: faults.kill(servo),
        "pause": pause,
        "dip": lambda: faults.sag(DIP * bench.guard.robot.supply_range[0]),
        "low supply": lambda: faults.sag(SAG * bench.guard.robot.supply_range[0]),
        "dead program": die,
    }[event]


def try_event(world: World, phase: str, event: str, cycles: int, rng: np.random.Generator) -> Trial:
    """Bring an event about at a random cycle of a phase; observe how the robot ends."""
    robot, at = world.robot, int(rng.integers(max(cycles - 1, 1)))
    servo = robot.joints[int(rng.integers(robot.n))].servo.id
    seen, when, present = [0], [np.inf], list[Phase]()
    with open_bench(world) as bench:
        act = strike(bench, event, servo)

        def come() -> None:
            pause = PAUSE if event == "pause" else 0.0
            when[0] = bench.virtual.physics.time + pause
            act()

        def look(_cycle: Cycle) -> None:
            if event == "dip" and bench.virtual.physics.time - when[0] > DIP_TIME:
                supply = robot.supply_voltage
                bench.ports.main.call(lambda: bench.virtual.physics.sag(supply))
            if phase != "hand-over" and present[-1:] == [PHASES[phase]]:
                seen[0] += 1
                if seen[0] == at + 1:
                    come()

        def note(change: PhaseChange) -> None:
            present.append(change.phase)

        if phase == "hand-over":
            confirm = bench.driver.hand_over

            def hand_over() -> tuple[str, ...]:
                if when[0] == np.inf and event != "dead program":
                    come()
                unconfirmed = confirm()
                if when[0] == np.inf:
                    come()
                return unconfirmed

            bench.driver.hand_over = hand_over  # type: ignore[method-assign]
        said: set[str] = set()
        went_on = False
        try:
            ending = choose_ending(world, phase)
            result = run_session(bench, world, ending, look, note, rises=rises(world, phase))
            said = set(result.unreleased)
            went_on = succeeded(result)
            if result.hand_over is not None:
                said = set(robot.joint_names)
        except ProgramDiedError:
            said = set(robot.joint_names)  # servos hold, as documented
        except DriverError:
            said = set(bench.driver.unreleased)
        bench.wait(AFTERMATH)
        on = {
            j.name for j, s in zip(robot.joints, bench.virtual.servos, strict=True) if s.torque_on
        }
        safe = bench.driver.trace.find_safe_time(when[0])
        return Trial(
            end=name_end(went_on, len(on), robot.n),
            safe_s=None if went_on else safe,
            unsaid=len(on - said),
            beyond_limits=bench.driver.trace.count_beyond_limits() + bench.driver.too_fast,
        )


def name_end(went_on: bool, driven: int, n: int) -> str:
    """Name the end of a robot of which some servos of ``n`` have torque on."""
    if went_on:
        return "as without it"
    return "limp" if not driven else "held" if driven == n else f"limp but for {driven}"


def succeeded(result: Rise | AfterStand) -> bool:
    """Return whether a session ended as without an event."""
    after = result.after if isinstance(result, Rise) else result
    return after is not None and after.succeeded and not result.unreleased


def try_stop(world: World, then: str, packets: int, rng: np.random.Generator) -> Trial:
    """Stop a robot at a random packet of a session; count those of a session without stop: 0."""
    counted = [0]
    at = int(rng.integers(packets)) if packets else -1
    with open_bench(world) as bench:
        port = bench.driver.chains[0].bus.port
        write, handed = port.write, [-1]

        def count(data: bytes) -> None:
            if counted[0] == at:
                bench.guard.stop("a key was pressed")
            counted[0] += 1
            write(data)

        port.write = count  # type: ignore[method-assign]
        confirm = bench.driver.hand_over

        def hand_over() -> tuple[str, ...]:
            unconfirmed = confirm()
            handed[0] = counted[0]
            return unconfirmed

        bench.driver.hand_over = hand_over  # type: ignore[method-assign]
        result = run_session(bench, world, then)
        bench.wait(AFTERMATH)
        on = sum(servo.torque_on for servo in bench.virtual.servos)
        promised = result.hand_over is not None and (at < 0 or at >= handed[0] >= 0)
        end = "limp" if not on else "held as promised" if promised else "HELD"
        return Trial(
            end=end if packets else str(counted[0]),
            safe_s=None,
            unsaid=on if on and result.hand_over is None else 0,
            beyond_limits=bench.driver.trace.count_beyond_limits() + bench.driver.too_fast,
        )


def main(
    n: int = 20,
    stops: int = 0,
    seed: int = 0,
    servos: tuple[str, ...] = tuple(SERVOS),
    phases: tuple[str, ...] = tuple(PHASES),
    events: tuple[str, ...] = EVENTS,
    json: Path | None = None,
) -> None:
    """Print and write how robots end after events in each phase.

    Args:
        n: Robots of each row.
        stops: Sessions with a stop at a random packet.
        seed: Of the times, the servos and the packets.
        servos: Kinds of servos.
        phases: Phases.
        events: Events.
        json: File to write.
    """
    rows: list[dict[str, object]] = []
    for kind in servos if n else ():
        world = make_world(kind)
        for phase in phases:
            if phase == "way down" and world.robot.imu_kind is None:
                continue  # none begins
            cycles = count_cycles(world, phase)
            for event in events:
                rng = [np.random.default_rng([seed, k]) for k in range(n)]
                trials = [try_event(world, phase, event, cycles, each) for each in rng]
                rows.append({"servos": kind, "phase": phase, "event": event} | summarize(trials))
                print(rows[-1], flush=True)
    if stops:
        world = make_world("X")
        endings = ("hold", "limp", "hand-over")
        packets = {
            then: int(try_stop(world, then, 0, np.random.default_rng(seed)).end) for then in endings
        }
        trials = []
        for k in range(stops):
            rng, then = np.random.default_rng([seed, k]), endings[k % len(endings)]
            trials.append(try_stop(world, then, packets[then], rng))
        rows.append({"servos": "X", "phase": "any", "event": "stop"} | summarize(trials))
        print(rows[-1], flush=True)
    if json is not None:
        json.write_text(dumps({"name": "torque", "seed": seed, "n": n, "cases": rows}, indent=1))


def summarize(trials: list[Trial]) -> dict[str, object]:
    """Summarize the trials of a row."""
    times = [trial.safe_s for trial in trials if trial.safe_s is not None]
    return {
        "n": len(trials),
        "ends": dict(Counter(trial.end for trial in trials)),
        "safe_median_s": float(np.median(times)) if times else None,
        "safe_max_s": max(times, default=None),
        "unsaid": sum(trial.unsaid for trial in trials),
        "beyond_limits": sum(trial.beyond_limits for trial in trials),
    }


if __name__ == "__main__":
    tyro.cli(main)
