"""`getup bus`: a virtual Dynamixel bus that any program can connect to."""

from __future__ import annotations

import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import arg

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.fault_schedule import FaultSchedule
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_robot import VirtualPorts, VirtualRobot
from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import WorldOptions, find_start

CHECK_PERIOD = 0.2  # s between two checks that the buses still run


@dataclass(frozen=True, kw_only=True)
class ServeBus(WorldOptions):
    """Serve a virtual bus with a simulated robot behind it, until stopped.

    Prints the path of the serial port; of a robot with several, one line each.
    """

    origin: Annotated[str, arg(name="from", metavar="supine|prone|left|right|FILE")] = "supine"
    """Initial posture: class of a sampled fall, or a posture file."""
    link: Annotated[Path | None, arg(metavar="PATH")] = None
    """Path of the port; default: in a temporary folder."""
    lock_step: bool = False
    """Advance time with the client's sync writes of goals instead of the clock."""
    faults: Annotated[Path | None, arg(metavar="FILE")] = None
    """TOML file of faults to inject."""
    powered: bool = False
    """Start with servo power on; without it, a client must switch it on at the board."""
    voltage: Annotated[float | None, arg(metavar="V")] = None
    """Supply [V]; default: the robot's nominal voltage."""
    latency: Annotated[float, arg(metavar="S")] = 0.0
    """Latency timer of the USB adapter [s]; FTDI adapters are shipped with 0.016."""

    def find_faults(self) -> list[str]:
        """List all problems of the options' values."""
        faults = super().find_faults()
        if self.voltage is not None and not 0.0 < self.voltage <= 48.0:
            faults.append(f"voltage is {self.voltage:g} V, expected above 0 V, at most 48 V")
        if not 0.0 <= self.latency <= 0.1:
            faults.append(f"latency is {self.latency:g} s, expected 0 s to 0.1 s")
        return faults

    def run(self) -> int:
        """Serve until stopped."""
        world = self.load_stage()
        rng = np.random.default_rng(self.seed)
        simulation = Simulation(world, voltage=self.voltage)
        robot = VirtualRobot(simulation, powered=self.powered)
        ids = [servo.id for servo in robot.servos]
        schedule = FaultSchedule.from_file(self.faults, ids) if self.faults else None
        robot.place(find_start(world, self.origin, rng).posture)
        time_mode = TimeMode.LOCK_STEP if self.lock_step else TimeMode.REAL_TIME
        ports = VirtualPorts(
            robot,
            time_mode=time_mode,
            link=self.link,
            rng=rng,
            schedule=schedule,
            adapter_latency=self.latency,
        )
        with ports:
            for path in ports.paths.values():
                print(path, flush=True)
            print(describe(robot), file=sys.stderr)
            _serve(ports)
        return DID_IT


def describe(robot: VirtualRobot) -> str:
    """Compose the banner: rate, and how the servos get power."""
    text = f"getup: {robot.robot.name} on a virtual bus at {robot.bus.baud} bit/s, Ctrl-C ends it"
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
