"""A whole robot on a virtual bus: its servos, its board, and the body that they move."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.errors import SetupError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.quirks import Quirks
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.serving.fault_schedule import Schedule
from drivers.virtual_bus.serving.server import TimeMode, VirtualBus
from drivers.virtual_bus.servo_physics import ServoPhysics
from robots import BusSettings, Posture, Robot

FIRMWARE = 46


class NoBusError(SetupError):
    """A robot's description does not say how its servos are reached."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(
            f"robot '{robot.name}' has no servo bus: add a [bus] table to its robot.toml"
        )
        self.robot = robot.name


class VirtualRobot:
    """Servos that speak the protocol, with a simulation behind them."""

    def __init__(
        self,
        simulation: Simulation,
        *,
        firmware: int = FIRMWARE,
        powered: bool = False,
        quirks: Quirks | None = None,
    ) -> None:
        """Hang a simulated robot's servos on its buses.

        Args:
            simulation: Physics of the robot.
            firmware: Of all servos.
            powered: Whether servos have power before the board switches it on.
            quirks: What the devices do where the manual is silent.

        Raises:
            NoBusError: if the robot has no bus.
        """
        self.robot, self.simulation = simulation.robot, simulation
        self.quirks = quirks = quirks or Quirks()
        self.bus = check_bus(self.robot)
        self.servos = [
            VirtualServo(
                joint.servo.id,
                joint.servo.model.name,
                firmware=firmware,
                baud=self.bus.baud,
                quirks=quirks,
            )
            for joint in self.robot.joints
        ]
        self.board = self._build_board(quirks)
        if self.board is not None and self.bus.board is not None:
            if powered:
                self.board.poke("dynamixel_power", 1)
            elif self.bus.board.powers_servos:
                self._switch_power(False)
        axes = self.bus.board.imu_axes if self.bus.board else (1, 1, 1)
        self.body = ServoPhysics(simulation, self.servos, self.board, axes)
        self.chains = {port.name: self._build_chain(port.name, quirks) for port in self.bus.ports}

    def place(self, posture: Posture) -> None:
        """Put the robot somewhere, at rest, cool and limp."""
        self.body.place(posture)

    def _build_board(self, quirks: Quirks | None) -> VirtualBoard | None:
        settings = self.bus.board
        if settings is None:
            return None
        on_power: Callable[[bool], None] = self._switch_power
        if not settings.powers_servos:
            on_power = _ignore
        return VirtualBoard(settings.id, baud=self.bus.baud, on_power=on_power, quirks=quirks)

    def _switch_power(self, on: bool) -> None:
        for servo in self.servos:
            servo.powered = on

    def _build_chain(self, name: str, quirks: Quirks | None) -> Chain:
        port = next(port for port in self.bus.ports if port.name == name)
        names = self.robot.joint_names
        devices: list[VirtualServo | VirtualBoard] = [
            self.servos[names.index(joint)] for joint in port.joints
        ]
        if self.board is not None and self.bus.board is not None and self.bus.board.port == name:
            devices.append(self.board)
        return Chain(devices, quirks)


@dataclass(frozen=True)
class _Passenger:
    """The body as a second port sees it: the first port's traffic lets time pass."""

    body: ServoPhysics

    @property
    def time(self) -> float:
        return self.body.time

    @property
    def period(self) -> float:
        return self.body.period

    def advance(self, to: float) -> None:
        del to

    def pass_period(self) -> None:
        return

    def heat(self, servo_id: int, temperature: float) -> None:
        self.body.heat(servo_id, temperature)

    def sag(self, voltage: float) -> None:
        self.body.sag(voltage)


class VirtualPorts:
    """The serial ports of a virtual robot, one a bus, served while the block lasts.

    In lock-step, time passes with the traffic on the robot's last port: a driver writes
    its goals there last.
    """

    def __init__(
        self,
        robot: VirtualRobot,
        *,
        pace: TimeMode,
        link: Path | None = None,
        rng: np.random.Generator | None = None,
        schedule: Schedule | None = None,
        adapter_latency: float = 0.0,
    ) -> None:
        """Prepare the ports.

        Args:
            robot: What hangs on them.
            pace: How time passes.
            link: Path of the port; of several, each gets ``-NAME`` appended.
            rng: Source of chance in faults.
            schedule: Faults to come, on the last port.
            adapter_latency: How often the USB adapter hands bytes over [s].
        """
        names = list(robot.chains)
        self.buses: dict[str, VirtualBus] = {}
        for name in names:
            leads = name == names[-1]
            passenger = pace is TimeMode.LOCK_STEP and not leads
            self.buses[name] = VirtualBus(
                robot.chains[name],
                _Passenger(robot.body) if passenger else robot.body,
                pace=pace,
                link=_link(link, name, len(names)),
                rng=rng.spawn(1)[0] if rng else None,
                schedule=schedule if leads else None,
                adapter_latency=adapter_latency,
                strict_stuffing=robot.quirks.strict_stuffing,
            )
        self._open = ExitStack()

    @property
    def main(self) -> VirtualBus:
        """Return the bus with which time passes."""
        return list(self.buses.values())[-1]

    @property
    def paths(self) -> dict[str, str]:
        """Return the path of each port, by the robot's names of them."""
        return {name: bus.path for name, bus in self.buses.items()}

    def __enter__(self) -> VirtualPorts:
        """Make and serve the ports."""
        with ExitStack() as opening:
            for bus in self.buses.values():
                opening.enter_context(bus)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """Take the ports away."""
        self._open.close()


def check_bus(robot: Robot) -> BusSettings:
    """Return how a robot's servos are reached.

    Raises:
        NoBusError: if nobody said.
    """
    if robot.bus is None:
        raise NoBusError(robot)
    return robot.bus


def _link(link: Path | None, name: str, count: int) -> Path | None:
    if link is None or count == 1:
        return link
    return link.with_name(f"{link.name}-{name}")


def _ignore(on: bool) -> None:
    del on
