"""`getup bus`: a virtual Dynamixel bus that any program can connect to."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import arg

from drivers.dynamixel.control_table import table_named, table_names, types_of
from drivers.service.scan import check_rate
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import ServedRobot, serve_robot
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.virtual_robot import VirtualDevices
from humanoid_getup.commands.command import program
from humanoid_getup.commands.console import warn
from humanoid_getup.commands.errors import DID_IT, BadInputError, refusing, refusing_own
from humanoid_getup.commands.files import READ
from humanoid_getup.commands.inputs import find_start, load_robot
from humanoid_getup.commands.options import LoadOption, SceneOptions
from humanoid_getup.commands.prompt import TypedLines
from humanoid_getup.commands.robot.virtual_person import VirtualPerson
from humanoid_getup.commands.values import Items
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Joint, Posture, Robot
from robots.bench import BARE, Load, ServoBench, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.storage.validation import between

CHECK_PERIOD = 0.2  # s between two checks that the buses still run
LATE = 0.5  # s by which physics falls further behind before that is said
CLEAR = "\r\x1b[K"  # returns to the start of a line and clears it


@dataclass(frozen=True, kw_only=True)
class ServeBus(LoadOption, SceneOptions):
    """Serve a virtual bus with a simulated robot behind it, until stopped.

    Prints the path of the serial port; of a robot with several, one line each, and one for an IMU
    on a line of its own: PATH-imu with --link PATH, a serial port or the socket of an I2C bus.
    Behind it are, with --servos, servos on a bench instead of a robot. What is typed meanwhile, a
    person at the robot does: hold zero, turn l_knee:20, let go, lay prone.
    """

    servos: Annotated[
        tuple[str, ...], Items(twice=True), arg(metavar="MODEL:ID,ID,MODEL:ID,...")
    ] = ()
    """Servos on a bench instead of a robot: each model with its ids, such as
    XL430-W250:1,2,XM430-W350:3."""
    load: Annotated[str, arg(metavar="NAME:KG,...|KG:M")] = ""
    """Masses [kg] that the robot holds, such as left_hand:0.2; or the mass that hangs from each
    horn on a bench, and its distance [m]."""
    baud: Annotated[int | None, arg(metavar="BIT/S")] = None
    """Baud rate of the bus [bit/s]; default: the robot's, or 57600 on a bench, as servos are
    shipped."""
    origin: Annotated[str, READ, arg(name="from", metavar="supine|prone|left|right|FILE")] = (
        "supine"
    )
    """Initial posture: class of a sampled fall, or a posture file."""
    link: Annotated[Path | None, arg(metavar="PATH")] = None
    """Path of the port; default: in a temporary folder."""
    hold: Annotated[str | None, READ, arg(metavar="zero|standing|FILE")] = None
    """Posture in which a person holds the robot, instead of a fall: torso and joints without torque
    stay; servos with torque move theirs."""
    turn: Annotated[tuple[str, ...], arg(metavar="JOINT:DEG,...")] = ()
    """Joints that the person turns, each by an angle [°]; with --hold."""
    lock_step: bool = False
    """Advance time with the client's sync writes of goals instead of the clock."""
    powered: bool = False
    """Start with servo power on; without it, a client must switch it on at the board."""
    voltage: Annotated[float | None, between(1.0, 48.0, "V"), arg(metavar="V")] = None
    """Supply [V]; default: the robot's nominal voltage."""
    latency: Annotated[float, between(0.0, 0.1, "s"), arg(metavar="S")] = 0.0
    """Latency timer of the USB adapter [s]; FTDI adapters: 0.016 as shipped."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.turn and self.hold is None:
            yield "--turn needs --hold: a person turns joints of a robot that is held"


@program("bus")
def serve_bus(command: ServeBus) -> int:
    """Serve until stopped."""
    robot = _load_robot(command)
    if isinstance(robot, ServoBench):
        world = robot
    else:
        with refusing():
            world = World(robot, load_scene(command.scene, robot, command.seed))
    devices = VirtualDevices(robot, powered=command.powered)
    rng = np.random.default_rng(command.seed)
    options = PortOptions(link=command.link, adapter_latency=command.latency)
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
    if command.baud is not None:
        check_rate(command.baud)
    if command.servos:
        return _build_bench(command.servos, command.load, command.baud)
    robot = load_robot(command, takes_bench=True)
    if command.baud is None or robot.bus is None:
        return robot
    return replace(robot, bus=replace(robot.bus, baud=command.baud))


def _find_start(world: World | ServoBench, origin: str, rng: np.random.Generator) -> Posture:
    """Find the posture in which a robot lies; a bench is where it is."""
    if isinstance(world, ServoBench):
        return world.standing
    return find_start(world, origin, rng, warn).posture


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
        with refusing_own():
            person.do(sentence)
    except BadInputError as error:
        print(f"getup: {error}", file=sys.stderr)
    else:
        print(f"done: {sentence}", flush=True)


# Servos on a bench -------------------------------------------------------------------------------


def _build_bench(words: Sequence[str], load: str, baud: int | None) -> ServoBench:
    """Build the bench of --servos and --load, with a cycle that suits the baud rate."""
    servos = list_bench_servos(words)
    hanging = Load.parse(load) if load else BARE
    table = table_named(servos[0].servo.model.name)
    shipped = table.bauds[table["baud_rate"].default or 0]
    return make_bench(servos, baud=baud or shipped, loads=[hanging] * len(servos))


def list_bench_servos(words: Sequence[str]) -> list[Joint]:
    """List the servos that words name: MODEL:ID, or the ID of another one of the same model."""
    joints: list[Joint] = []
    model = ""
    for word in words:
        before, colon, number = word.rpartition(":")
        model = _find_type(before) if colon else model
        if model not in servo_models():
            near = get_close_matches(model.upper(), servo_models(), n=3) or servo_models()
            raise ValueError(
                f"--servos has '{word}', expected MODEL:ID with a model of {', '.join(near)}"
            )
        figures = servo_models()[model]
        if not number.isdecimal() or int(number) > figures.max_id:
            raise ValueError(f"--servos has '{word}', expected an id from 0 to {figures.max_id}")
        joints.append(make_bench_joint(figures, int(number)))
    ids = [joint.servo.id for joint in joints]
    if twice := [i for i in ids if ids.count(i) > 1]:
        raise ValueError(f"--servos has the id {twice[0]} twice, expected each once")
    return joints


def _find_type(name: str) -> str:
    """Return the type of a name, or the first with the control table of a model of that name."""
    known = servo_models()
    if name in known or name not in table_names():
        return name
    return next((each for each in types_of(table_named(name)) if each in known), name)
