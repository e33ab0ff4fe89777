"""A robot's buses opened for service, to virtual servos in memory."""

from collections.abc import Iterator
from contextlib import contextmanager

from memory_port import MemoryPort

from drivers.service.session import RobotBus, open_robot_bus
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import Robot


class ServiceBench:
    """A virtual robot, the ports in front of it, and the service session on them."""

    def __init__(self, robot: Robot, *, powered: bool = True) -> None:
        self.robot = robot
        self.virtual = VirtualRobot(Simulation(robot), powered=powered)
        self.ports: dict[str, MemoryPort] = {}

    def servo(self, joint: str) -> VirtualServo:
        return self.virtual.servos[self.robot.joint_names.index(joint)]

    @property
    def port(self) -> MemoryPort:
        return next(iter(self.ports.values()))

    @contextmanager
    def open(self) -> Iterator[RobotBus]:
        names = {name: name for name in self.robot.bus.ports}
        with open_robot_bus(self.robot, names, make_port=self._make_port) as bus:
            yield bus

    def _make_port(self, path: str, baud: int) -> MemoryPort:
        self.ports[path] = MemoryPort(self.virtual.chains[path], baud, self.virtual.physics)
        return self.ports[path]
