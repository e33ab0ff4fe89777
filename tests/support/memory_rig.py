"""A robot whose driver talks to virtual servos in memory, in lock-step."""

from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import replace

import numpy as np
from memory_port import MemoryPort

from drivers import Command, State
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.errors import UnreleasedError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.device import Quirks
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import Robot


class Rig:
    """A backend, the virtual robot that it drives, and the ports between them."""

    def __init__(
        self,
        robot: Robot,
        *,
        firmware: int = 46,
        quirks: Quirks | None = None,
        prepare: Callable[[VirtualRobot], None] = lambda _: None,
        **settings,
    ) -> None:
        self.robot = robot
        self.virtual = VirtualRobot(Simulation(robot), firmware=firmware, quirks=quirks)
        prepare(self.virtual)
        self.ports: dict[str, MemoryPort] = {}
        self.clock = settings.pop("clock", None) or CycleClock()
        names = list(robot.bus.ports)
        self.backend = DynamixelBackend(
            robot,
            {name: name for name in names},
            clock=self.clock,
            options=DriverOptions(make_port=self._make_port),
            **settings,
        )

    def _make_port(self, path: str, baud: int) -> MemoryPort:
        last = list(self.robot.bus.ports)[-1]
        # As on the virtual bus: time passes with the last port's traffic.
        body = self.virtual.physics if path == last else Still()
        self.ports[path] = MemoryPort(self.virtual.chains[path], baud, body)
        return self.ports[path]

    @property
    def port(self) -> MemoryPort:
        return next(iter(self.ports.values()))

    def servo(self, joint: str) -> VirtualServo:
        return self.virtual.servos[self.robot.joint_names.index(joint)]

    def peek(self, item: str) -> list[int]:
        return [servo.peek(item) for servo in self.virtual.servos]

    def poke(self, item: str, value: int) -> None:
        for servo in self.virtual.servos:
            servo.poke(item, value)

    def true_angles(self) -> np.ndarray:
        """Return the angles that the encoders tell at this moment [rad]."""
        return np.array(
            [
                joint.servo.to_rad(servo.peek("present_position"))
                for joint, servo in zip(self.robot.joints, self.virtual.servos, strict=True)
            ]
        )

    def turn(self, command: Command | None = None, cycles: int = 1) -> State:
        """Run some cycles; return the last measurement."""
        for _ in range(cycles):
            state = self.backend.read()
            self.sent = self.backend.write(command or self.hold(state))
        return state

    def hold(self, state: State) -> Command:
        return Command.position(self.robot, state.joint_pos)

    def __enter__(self) -> "Rig":
        self.backend.connect()
        return self

    def __exit__(self, *error: object) -> None:
        dead = not all(servo.alive for servo in self.virtual.servos)
        lost = dead or any(port.unplugged for port in self.ports.values())
        with suppress(UnreleasedError) if lost else nullcontext():
            self.backend.close()


class Still:
    """A body that lets no time pass: another port's traffic does."""

    time = 0.0

    def advance(self, to: float) -> None:
        del to

    def pass_period(self) -> None:
        pass


def split(robot: Robot) -> Robot:
    """Give a robot two ports, its joints shared out between them in turn."""
    names = robot.joint_names
    ports = {"left": names[::2], "right": names[1::2]}
    board = replace(robot.bus.board, port="right")
    return replace(robot, bus=replace(robot.bus, ports=ports, board=board))
