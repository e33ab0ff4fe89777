"""`getup bus`: a virtual Dynamixel bus that any program can connect to."""

from __future__ import annotations

import sys
import threading

import numpy as np

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.fault_schedule import FaultSchedule
from drivers.virtual_bus.serving.server import PortOptions, TimeMode
from drivers.virtual_bus.virtual_robot import VirtualPorts, VirtualRobot
from humanoid_getup.cli.options.hardware import ServeBus
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import find_start, load_world

CHECK_PERIOD = 0.2  # s between two checks that the buses still run


def serve_bus(command: ServeBus) -> int:
    """Serve until stopped."""
    world = load_world(command)
    rng = np.random.default_rng(command.seed)
    simulation = Simulation(world, voltage=command.voltage)
    robot = VirtualRobot(simulation, powered=command.powered)
    ids = [servo.id for servo in robot.servos]
    schedule = FaultSchedule.from_file(command.faults, ids) if command.faults else None
    robot.place(find_start(world, command.origin, rng).posture)
    time_mode = TimeMode.LOCK_STEP if command.lock_step else TimeMode.REAL_TIME
    options = PortOptions(
        link=command.link, adapter_latency=command.latency, schedule=schedule, rng=rng
    )
    ports = VirtualPorts(robot, time_mode=time_mode, options=options)
    with ports:
        for path in ports.paths.values():
            print(path, flush=True)
        print(describe(robot), file=sys.stderr)
        _serve(ports)
    return DID_IT


def describe(robot: VirtualRobot) -> str:
    """Compose the banner: rate, and how the servos get power."""
    text = f"getup: {robot.robot.name} on a virtual bus at {robot.bus.baud} bit/s, Ctrl-C ends it"
    imu = robot.robot.imu
    if robot.imu is not None and imu is not None and not imu.is_serial:
        text += (
            "\ngetup: its IMU is on I2C, which no other program can reach: "
            "--backend virtual without --port has it"
        )
    board = robot.board
    if board is None or all(servo.powered for servo in robot.servos):
        return text
    register = board.table["dynamixel_power"].address
    return (
        f"{text}\ngetup: the servos have no power and do not answer until 1 is written to "
        f"register {register} of the board, id {board.id} (getup's driver does that); "
        "--powered starts with their power on"
    )


def _serve(ports: VirtualPorts) -> None:
    """Wait for an interrupt, or for a bus that ends by itself."""
    never = threading.Event()
    try:
        while all(bus.running for bus in ports.buses.values()):
            never.wait(CHECK_PERIOD)
    except KeyboardInterrupt:
        return
    raise BadInputError("the virtual bus stopped unexpectedly")
