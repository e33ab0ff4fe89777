"""Cycle time of the Dynamixel backend against the wire's limit and against its peers.

    python benchmarks/bus_cycle.py --cycles 500 --json bus_cycle.json

A virtual bus in a separate process replies in real time, at the speed of the wire, and in the
real-time class of the scheduler, as servos do not wait for a processor; its servos are not
simulated. One after another, each client does the same job as fast as it can: current,
velocity and position of 20 servos, the IMU, and 20 goals; ours also in the real-time class, as in
the control loop. Peers: the group handlers of
`dynamixel-sdk`, plain and fast, as shipped and with its timeout shortened to that of a good
adapter, and LeRobot's Dynamixel bus, which reads one quantity at a time
(pip install --no-deps lerobot deepdiff orderly-set tqdm cachebox). A peer's group read that fails
is repeated and counted; ours is not repeated, and counted if a joint or the IMU was not measured in
the cycle. `--busy` measures beside some processes that never rest.
"""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
import time
import types
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from json import dumps
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from drivers import Command, SafetyGuard, State
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.bus import BITS_PER_BYTE
from drivers.dynamixel.protocol2 import Span, read, sync_read, sync_write
from drivers.real_time_class import in_real_time_class
from drivers.serial_port import SerialPort
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.serving.exchange import Physics
from drivers.virtual_bus.serving.server import VirtualBus
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import Robot, load_robot

BAUDS = (1_000_000, 2_000_000, 3_000_000, 4_000_000)
WARM_UP = 50  # cycles
STATE, GOAL, IMU = (126, 10), (116, 4), (32, 12)  # register and bytes
PERIOD = 0.008  # s, OP3's cycle
AS_SHIPPED, TUNED = 16, 1  # ms that dynamixel-sdk waits for a USB adapter
BUSY = (sys.executable, "-c", "while True: pass")


@dataclass(frozen=True)
class Client:
    """One program that talks to the bus."""

    turn: Callable[[], None]
    """Do one cycle."""
    cycle_bytes: int
    """Bytes on the wire in one cycle, both ways, when nothing is stuffed."""
    failures: list[int] = field(default_factory=lambda: [0])
    """One number: reads that failed."""


def robot_at(baud: int) -> Robot:
    """Load an OP3 whose bus runs at a rate [bit/s]."""
    robot = load_robot("op3")
    assert robot.bus is not None
    return replace(robot, bus=replace(robot.bus, baud=baud))


class StillPhysics(Physics):
    """No physics: only the clocks of the devices advance."""

    is_light = True

    def __init__(self, devices: Chain) -> None:
        self.time, self._devices = 0.0, devices

    def advance(self, to: float) -> None:
        """Advance the devices to a bus time [s]."""
        self.time = max(self.time, to)
        self._devices.advance(self.time)


def serve(baud: int, pipe: Connection) -> None:
    """Serve a bus until a message arrives."""
    robot = VirtualRobot(Simulation(robot_at(baud)), powered=True)
    for servo in robot.servos:
        servo.poke("return_delay_time", 0)
    if robot.board is not None:
        robot.board.poke("return_delay_time", 0)
    with VirtualBus(robot.chains["main"], StillPhysics(robot.chains["main"])) as bus:
        pipe.send(bus.path)
        pipe.recv()


@contextmanager
def bus_at(baud: int) -> Iterator[str]:
    """Run a bus in a separate process; yield its path."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(baud, theirs), daemon=True)
    process.start()
    try:
        yield ours.recv()
        ours.send("stop")
    finally:
        process.join(10.0)
        process.terminate()


@contextmanager
def our_backend(path: str, baud: int) -> Iterator[Client]:
    """Use our backend behind the guard."""
    robot = robot_at(baud)
    backend = DynamixelBackend(robot, {"main": path})
    with SafetyGuard(backend) as guard:
        command, failures = Command.position(robot, guard.read().joint_pos), [0]

        def turn() -> None:
            failures[0] += is_stale(guard.read())
            guard.write(command)

        for _ in range(WARM_UP):
            turn()
        failures[0] = 0
        yield Client(turn, backend.cycle_bytes, failures)


@contextmanager
def our_backend_unguarded(path: str, baud: int) -> Iterator[Client]:
    """Use our backend without the guard, as the peers do."""
    robot = robot_at(baud)
    with DynamixelBackend(robot, {"main": path}) as backend:
        command, failures = Command.position(robot, backend.read().joint_pos), [0]

        def turn() -> None:
            failures[0] += is_stale(backend.read())
            backend.write(command)

        for _ in range(WARM_UP):
            turn()
        failures[0] = 0
        yield Client(turn, backend.cycle_bytes, failures)


def is_stale(state: State) -> bool:
    """Return whether a joint or the IMU was not measured in its cycle."""
    return bool(state.joint_age.max() > 0.0 or state.imu_age > 0.0)


@contextmanager
def our_loop(path: str, baud: int) -> Iterator[Client]:
    """Use our backend behind the guard in the real-time class, as the control loop does."""
    with our_backend(path, baud) as client, in_real_time_class() as is_permitted:
        if not is_permitted:
            print("the system does not permit the real-time class", file=sys.stderr)
        yield client


@contextmanager
def bare_bytes(path: str, baud: int) -> Iterator[Client]:
    """Send precomputed frames and wait for all bytes of the replies: the cost of the bus itself."""
    ids = [joint.servo.id for joint in robot_at(baud).joints]
    group = sync_read(ids, Span(*STATE), fast=True).encode()
    imu = read(200, Span(*IMU)).encode()
    middle = dict.fromkeys(ids, (2048).to_bytes(GOAL[1], "little"))
    goals = sync_write(GOAL[0], middle).encode()
    port, failures = SerialPort(path, baud), [0]
    port.open()

    def exchange(frame: bytes, size: int) -> None:
        port.write(frame)
        while size > 0:
            chunk = port.read(time.monotonic() + 0.1)
            if not chunk:
                failures[0] += 1
                return
            size -= len(chunk)

    def turn() -> None:
        exchange(group, 8 + 14 * len(ids))
        exchange(imu, 23)
        port.write(goals)

    for _ in range(WARM_UP):
        turn()
    failures[0] = 0
    yield Client(turn, len(group) + 8 + 14 * len(ids) + len(imu) + 23 + len(goals), failures)
    port.close()


@contextmanager
def sdk_handlers(path: str, baud: int, *, fast: bool, latency: int) -> Iterator[Client]:
    """Use the group handlers of dynamixel-sdk, which wait some ms for an adapter."""
    import dynamixel_sdk as sdk
    from dynamixel_sdk import port_handler

    port_handler.LATENCY_TIMER = latency
    port, packets = sdk.PortHandler(path), sdk.PacketHandler(2.0)
    assert port.openPort() and port.setBaudRate(baud)
    ids = [joint.servo.id for joint in robot_at(baud).joints]
    reader = sdk.GroupSyncRead(port, packets, *STATE)
    for device in ids:
        reader.addParam(device)
    receive = reader.fastSyncRead if fast else reader.txRxPacket
    writer = sdk.GroupSyncWrite(port, packets, *GOAL)

    failures = [0]

    def take() -> int:
        try:
            return receive()
        except IndexError:  # of a fast reply that arrived in part
            return sdk.COMM_RX_CORRUPT

    def turn() -> None:
        while take() != sdk.COMM_SUCCESS:
            failures[0] += 1
        for device in ids:
            current = reader.getData(device, 126, 2)
            velocity = reader.getData(device, 128, 4)
            position = reader.getData(device, 132, 4)
            del current, velocity
            writer.addParam(device, position.to_bytes(4, "little"))
        while packets.readTxRx(port, 200, *IMU)[1] != sdk.COMM_SUCCESS:
            failures[0] += 1
        writer.txPacket()
        writer.clearParam()

    for _ in range(WARM_UP):
        turn()
    answer = 8 + 14 * len(ids) if fast else 21 * len(ids)
    failures[0] = 0
    yield Client(turn, 14 + len(ids) + answer + 14 + 23 + 14 + 5 * len(ids), failures)
    port.closePort()


def open_lerobot(path: str, robot: Robot) -> Any:
    """Open LeRobot's bus for a robot, whose servos are taken for XM430-W350."""
    stub_learning_libraries()
    from lerobot.motors import Motor, MotorNormMode  # pyright: ignore[reportMissingImports]
    from lerobot.motors.dynamixel import DynamixelMotorsBus  # pyright: ignore[reportMissingImports]

    motors = {
        joint.name: Motor(joint.servo.id, "xm430-w350", MotorNormMode.DEGREES)
        for joint in robot.joints
    }
    assert robot.bus is not None
    bus = DynamixelMotorsBus(path, motors)
    bus.connect(handshake=False)
    bus.set_baudrate(robot.bus.baud)
    return bus


@contextmanager
def lerobot_bus(path: str, baud: int) -> Iterator[Client]:
    """Use LeRobot's bus, and its packet handler for the IMU, which the bus does not support."""
    import dynamixel_sdk as sdk

    bus = open_lerobot(path, robot := robot_at(baud))
    packets: Any = bus.packet_handler
    failures = [0]

    def ask(quantity: str) -> dict[str, Any]:
        while True:
            try:
                return bus.sync_read(quantity, normalize=False)
            except ConnectionError:
                failures[0] += 1

    def turn() -> None:
        ask("Present_Current")
        ask("Present_Velocity")
        position = ask("Present_Position")
        while packets.readTxRx(bus.port_handler, 200, *IMU)[1] != sdk.COMM_SUCCESS:
            failures[0] += 1
        bus.sync_write("Goal_Position", position, normalize=False)

    for _ in range(WARM_UP):
        turn()
    n = robot.n
    failures[0] = 0
    yield Client(turn, 3 * (14 + n) + (13 + 15 + 15) * n + 14 + 23 + 14 + 5 * n, failures)
    bus.disconnect(disable_torque=False)


def stub_learning_libraries() -> None:
    """Let LeRobot's motors be imported without its learning libraries: they need none."""

    class Anything(types.ModuleType):
        def __getattr__(self, name: str) -> Any:
            if name.startswith("__"):
                raise AttributeError(name)
            return object

    names = ("torch", "accelerate", "datasets", "datasets.utils", "datasets.utils.logging")
    for name in names:
        if name not in sys.modules:
            sys.modules[name] = Anything(name)


CLIENTS: dict[str, Callable[..., Any]] = {
    "ours": our_backend_unguarded,
    "ours, guarded": our_backend,
    "ours, guarded, real-time": our_loop,
    "bare bytes": bare_bytes,
    "dynamixel-sdk, fast": partial(sdk_handlers, fast=True, latency=AS_SHIPPED),
    "dynamixel-sdk, plain": partial(sdk_handlers, fast=False, latency=AS_SHIPPED),
    "dynamixel-sdk, fast, tuned": partial(sdk_handlers, fast=True, latency=TUNED),
    "dynamixel-sdk, plain, tuned": partial(sdk_handlers, fast=False, latency=TUNED),
    "lerobot": lerobot_bus,
}


def measure(client: Client, cycles: int, baud: int) -> dict[str, float]:
    """Time cycles back to back, and the processor time that the client spends in them."""
    wall = np.zeros(cycles)
    busy = time.process_time()
    for k in range(cycles):
        begun = time.perf_counter()
        client.turn()
        wall[k] = time.perf_counter() - begun
    busy = (time.process_time() - busy) / cycles
    wire = client.cycle_bytes * BITS_PER_BYTE / baud
    median = float(np.median(wall))
    return {
        "bytes": client.cycle_bytes,
        "wire_us": wire * 1e6,
        "cycle_us": median * 1e6,
        "cycle_p99_us": float(np.percentile(wall, 99)) * 1e6,
        "over_wire": median / wire,
        "processor_us": busy * 1e6,
        "missed_125_hz": float(np.mean(wall > PERIOD)),
        "failures": client.failures[0],
    }


@contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """Keep processors busy."""
    with ExitStack() as running:
        for _ in range(count):
            process = running.enter_context(subprocess.Popen(BUSY))
            running.callback(process.kill)
        yield


def main(
    *, cycles: int = 500, bauds: tuple[int, ...] = BAUDS, busy: int = 0, json: Path | None = None
) -> None:
    """Measure every client at every baud rate.

    Args:
        cycles: Cycles of each measurement.
        bauds: Baud rates [bit/s].
        busy: Processes that never rest beside it.
        json: File for the results.
    """
    with busy_processes(busy):
        cases = measure_all(cycles, bauds)
    if json:
        record = {"name": "bus_cycle", "seed": None, "n": cycles, "busy": busy, "cases": cases}
        json.write_text(dumps(record, indent=1) + "\n", "utf-8")


def measure_all(cycles: int, bauds: tuple[int, ...]) -> dict[str, dict[str, float]]:
    """Measure every client at every baud rate; return the figures of each."""
    cases: dict[str, dict[str, float]] = {}
    for baud in bauds:
        for name, client in CLIENTS.items():
            with bus_at(baud) as path:
                try:
                    with client(path, baud) as ready:
                        case = measure(ready, cycles, baud)
                except ImportError as error:
                    print(f"{name}: skipped, {error}", file=sys.stderr)
                    continue
            cases[f"{name} at {baud / 1e6:g} Mbps"] = case
            figures = ", ".join(f"{key} {value:.4g}" for key, value in case.items())
            print(f"{name:22} {baud / 1e6:g} Mbps: {figures}", flush=True)
    return cases


if __name__ == "__main__":
    tyro.cli(main)
