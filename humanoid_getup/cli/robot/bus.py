"""`getup bus`: a virtual Dynamixel bus that any program can connect to."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from drivers.service.scan import check_rate
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import ServedRobot, serve_robot
from drivers.virtual_bus.serving.fault_schedule import FaultSchedule
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.virtual_robot import VirtualDevices
from humanoid_getup.cli.options.hardware import ServeBus
from humanoid_getup.cli.robot.bench_words import build_bench
from humanoid_getup.cli.robot.virtual_person import VirtualPerson
from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.inputs import find_start, load_robot
from humanoid_getup.commands.prompt import TypedLines
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.bench import ServoBench

CHECK_PERIOD = 0.2  # s between two checks that the buses still run
LATE = 0.5  # s by which physics falls further behind before that is said
CLEAR = "\r\x1b[K"  # begins the line of a terminal anew


def serve_bus(command: ServeBus) -> int:
    """Serve until stopped."""
    robot = _load_robot(command)
    world = robot if isinstance(robot, ServoBench) else _build_world(command, robot)
    devices = VirtualDevices(robot, powered=command.powered)
    rng = np.random.default_rng(command.seed)
    ids = [servo.id for servo in devices.servos]
    schedule = FaultSchedule.from_file(command.faults, ids) if command.faults else None
    options = PortOptions(
        link=command.link, adapter_latency=command.latency, schedule=schedule, rng=rng
    )
    simulation = Simulation(world, voltage=command.voltage)
    time_mode = TimeMode.LOCK_STEP if command.lock_step else TimeMode.REAL_TIME
    serving = serve_robot(simulation, time_mode=time_mode, options=options, powered=command.powered)
    with serving as served, ThreadPoolExecutor(1) as beside:
        person = VirtualPerson(served, world, rng)
        if command.hold is None:
            start = beside.submit(_find_start, world, command.origin, rng)
            paths = served.paths
            served.place(start.result())
        else:
            paths = served.paths
            person.hold(command.hold)
        for turned in command.turn:
            person.turn(turned)
        for path in paths.values():
            print(path, flush=True)
        print(describe(devices, paths), file=sys.stderr)
        wait(served, person)
    return DID_IT


def _load_robot(command: ServeBus) -> Robot:
    """Load the robot, or build the bench of servos, with the baud rate of the command."""
    if command.servos:
        robot: Robot = build_bench(command.servos, command.load)
    else:
        robot = load_robot(command, takes_bench=True)
    if command.baud is None or robot.bus is None:
        return robot
    with refusing():
        check_rate(command.baud)
    return replace(robot, bus=replace(robot.bus, baud=command.baud))


def _build_world(command: ServeBus, robot: Robot) -> World:
    with refusing():
        return World(robot, load_scene(command.scene, robot, command.seed))


def _find_start(world: World | ServoBench, origin: str, rng: np.random.Generator) -> Posture:
    """Find the posture in which a robot lies; a bench is where it is."""
    if isinstance(world, ServoBench):
        return world.standing
    return find_start(world, origin, rng).posture


def describe(robot: VirtualDevices, paths: Mapping[str, str]) -> str:
    """Compose the banner: rate, how a client names several paths, and how servos get power."""
    text = f"getup: {robot.robot.name} on a virtual bus at {robot.bus.baud} bit/s, Ctrl-C ends it"
    if len(paths) > 1:
        named = ",".join(f"{name}={path}" for name, path in paths.items())
        text += f"\ngetup: connect with --port {named}"
    board = robot.board
    if board is None or all(servo.powered for servo in robot.servos):
        return text
    register = board.table["dynamixel_power"].address
    return (
        f"{text}\ngetup: the servos have no power and do not answer until 1 is written to "
        f"register {register} of the board, id {board.id} (getup's driver does that); "
        "--powered starts with their power on"
    )


def wait(served: ServedRobot, person: VirtualPerson) -> None:
    """Wait for an interrupt, or for a bus that ends by itself; do what is typed meanwhile.

    Where physics is late, that is one line: of a terminal it is kept up to date, elsewhere it is
    said once, and again at the end.
    """
    typed, said, in_place = TypedLines(), 0.0, sys.stderr.isatty()
    try:
        while served.running:
            for sentence in typed.wait(CHECK_PERIOD):
                _do(person, sentence)
            if served.behind > said + LATE and (in_place or not said):
                said = served.behind
                _say_late(said, CLEAR if in_place else "", end="" if in_place else "\n")
    except KeyboardInterrupt:
        return
    finally:
        if said:
            _say_late(served.behind, CLEAR if in_place else "")
    raise BadInputError("the virtual bus stopped unexpectedly")


def _say_late(behind: float, before: str, end: str = "\n") -> None:
    text = f"physics is {behind:.1f} s behind the clock: this computer has too little time for it"
    print(f"{before}getup: {text}", end=end, file=sys.stderr, flush=True)


def _do(person: VirtualPerson, sentence: str) -> None:
    """Do what was typed, and say that it was done, or why not."""
    try:
        person.do(sentence)
    except BadInputError as error:
        print(f"getup: {error}", file=sys.stderr)
    else:
        print(f"done: {sentence}", flush=True)
