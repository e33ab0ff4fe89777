"""A robot on a virtual bus for tests of commands, and a person who moves it by hand."""

import json
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from fault_injector import FaultInjector
from paths import TINY

from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.serial_port import SerialPort
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.commands.main import main
from robots import Posture, Robot, load_robot


def copy_tiny(folder: Path) -> Path:
    """Copy the smallest robot to where a calibration may be saved."""
    return Path(shutil.copytree(TINY, folder / "mine"))


class Served:
    """A virtual robot, its port, and what a person or a fault does to it."""

    def __init__(self, virtual: VirtualRobot, ports: VirtualPorts) -> None:
        self.virtual, self.robot, self._ports = virtual, virtual.robot, ports
        self.call = ports.main.call
        self.faults = FaultInjector(ports.main, np.random.default_rng(0))

    @property
    def path(self) -> str:
        return self._ports.main.path

    def make_port(self, path: str, baud: int = 1_000_000) -> SerialPort:
        """Make the client's end, on which nothing is waited for that does not come."""
        return self._ports.make_port(path, baud)

    def make_driver(self, prefix: str | None = None, **settings) -> DynamixelBackend:
        """Make a driver that loses no reply on a busy machine; a prefix says by which port."""
        make_port = SerialPort if prefix is not None else self.make_port
        return DynamixelBackend(
            self.robot,
            {name: (prefix or "") + path for name, path in self._ports.paths.items()},
            clock=CycleClock(),
            options=DriverOptions(make_port=make_port),
            **{"imu": self._ports.imu} | settings,
        )

    def place(self, **angles_deg: float) -> None:
        """Hold joints at angles [degrees], all others at 0."""
        angles = np.zeros(self.robot.n)
        for name, angle in angles_deg.items():
            angles[self.robot.joint_names.index(name)] = np.radians(angle)
        self.hold(angles)

    def hold(self, joint_pos: np.ndarray) -> None:
        standing = self.robot.standing
        posture = Posture(
            position=standing.position, orientation=standing.orientation, joint_pos=joint_pos
        )
        self.call(lambda: self.virtual.place(posture))

    def lean(self, orientation: np.ndarray) -> None:
        """Hold the robot in its stance, its torso in another orientation (4,)."""
        posture = replace(self.robot.standing, orientation=orientation)
        self.call(lambda: self.virtual.place(posture))

    def poke(self, joint: str, item: str, value: int) -> None:
        servo = self.virtual.servos[self.robot.joint_names.index(joint)]
        self.call(lambda: servo.poke(item, value))

    def restart(self) -> None:
        """Switch the power of all servos off and on."""
        for on in (False, True):
            self.call(lambda on=on: self._power(on))

    def _power(self, on: bool) -> None:
        for servo in self.virtual.servos:
            servo.powered = on

    def peek(self, item: str) -> list[int]:
        servos = self.virtual.servos
        return self.call(lambda: [servo.peek(item) for servo in servos])

    def heat(self, servo_id: int, temperature: float) -> None:
        """Let a servo report a temperature [°C]."""
        self.faults.heat(servo_id, temperature)

    def pass_time(self, seconds: float) -> None:
        """Let time pass without a byte on the bus [s]."""
        physics = self.virtual.physics
        self.call(lambda: physics.advance(physics.time + seconds))

    def stall(self, seconds: float) -> None:
        """Keep the bus from serving for some seconds of wall time, as a busy computer does."""
        self.call(lambda: time.sleep(seconds))

    def unplug(self) -> None:
        """Unplug the adapter."""
        self._ports.main.unplug()

    def add(self, device) -> None:
        """Hang one more device on the bus."""
        self.call(lambda: self._chain.devices.append(device))

    def exchange(self, place: int, device) -> None:
        """Put another device where one was."""

        def swap() -> None:
            self._chain.devices[place] = device

        self.call(swap)

    @property
    def _chain(self):
        return next(iter(self.virtual.chains.values()))


@contextmanager
def serving(
    robot: Robot | str | Path,
    *,
    time_mode: TimeMode = TimeMode.LOCK_STEP,
    powered: bool = True,
    voltage: float | None = None,
    prepare: Callable[[VirtualRobot], None] = lambda _: None,
) -> Iterator[Served]:
    """Serve a robot on a virtual bus."""
    if not isinstance(robot, Robot):
        robot = load_robot(robot)
    virtual = VirtualRobot(Simulation(robot, voltage=voltage), powered=powered)
    prepare(virtual)
    with VirtualPorts(virtual, time_mode=time_mode) as ports:
        yield Served(virtual, ports)


def run_json(*arguments: str, capsys) -> tuple[int, dict]:
    """Run `getup` with its figures on standard output; return exit code and figures."""
    code = main((*arguments, "--json", "-"))
    return code, json.loads(capsys.readouterr().out)
