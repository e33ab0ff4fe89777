"""A whole virtual robot: its servos, board and IMU, the simulation behind them, its ports."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from drivers.dynamixel.robot_bus import find_bus
from drivers.imu.build import build_i2c_source
from drivers.imu.source import ImuSource
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.quirks import Quirks
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c
from drivers.virtual_bus.imu.build import AnyVirtualImu, build_virtual_imu
from drivers.virtual_bus.imu.reading import ImuReading
from drivers.virtual_bus.serving.imu_line import ImuLine
from drivers.virtual_bus.serving.server import PortOptions, TimeMode, VirtualBus
from drivers.virtual_bus.servo_physics import ServoPhysics
from robots import Posture
from robots.imu import IMU_PORT, SensorAxes

FIRMWARE = 46


class VirtualRobot:
    """The servos, the board and the IMU of a robot, with a simulation behind them."""

    def __init__(
        self,
        simulation: Simulation,
        *,
        firmware: int = FIRMWARE,
        powered: bool = False,
        quirks: Quirks | None = None,
    ) -> None:
        """Build the devices of a simulated robot, with a firmware version for all servos.

        Args:
            powered: Whether servos have power from the start, not only once the board switches it.
            quirks: Device behavior that the manual leaves open; None for the defaults.

        Raises:
            SetupError: if the robot has no bus, or servos that cannot be driven.
        """
        self.robot, self.simulation = simulation.robot, simulation
        self.quirks = quirks = quirks or Quirks()
        self.bus = find_bus(self.robot)
        self.servos = [
            VirtualServo(
                joint.servo.id,
                joint.servo.model.name,
                firmware=firmware,
                baud=self.bus.baud,
                quirks=quirks,
                stall_current=joint.servo.model.stall_current,
            )
            for joint in self.robot.joints
        ]
        self.board = self._build_board(powered)
        self.physics = ServoPhysics(simulation, self.servos, self.board)
        self.chains = {port: self._build_chain(port) for port in self.bus.ports}
        self.imu: AnyVirtualImu | None = None
        """The IMU, if it has a line of its own."""
        self.on_imu_update: Callable[[], None] = lambda: None
        """Called after each measurement of the IMU."""
        if self.robot.imu is not None and self.robot.imu_kind != "board":
            self.imu = build_virtual_imu(self.robot.imu)
            self._imu_axes = SensorAxes.of(self.robot.imu.axes)
            simulation.on_sensor_update.append(self._sense_imu)
            self._sense_imu()

    def place(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off."""
        self.physics.place(posture)
        self._sense_imu()

    def _sense_imu(self) -> None:
        if self.imu is not None:
            self.imu.sense(ImuReading.of(self.simulation, self._imu_axes, self.physics.time))
            self.on_imu_update()

    def _build_board(self, powered: bool) -> VirtualBoard | None:
        settings = self.bus.board
        if settings is None:
            return None
        on_power = self._switch_power if settings.powers_servos else None
        board = VirtualBoard(
            settings.id,
            baud=self.bus.baud,
            on_power=on_power,
            quirks=self.quirks,
            settings=settings,
        )
        if powered:
            board.poke("dynamixel_power", 1)
        elif settings.powers_servos:
            self._switch_power(False)
        return board

    def _switch_power(self, on: bool) -> None:
        for servo in self.servos:
            servo.powered = on

    def _build_chain(self, port: str) -> Chain:
        names = self.robot.joint_names
        devices: list[VirtualServo | VirtualBoard] = [
            self.servos[names.index(joint)] for joint in self.bus.ports[port]
        ]
        if self.board and self.bus.board and self.bus.board.port == port:
            devices.append(self.board)
        return Chain(devices, self.quirks)


class VirtualPorts:
    """Serves the serial ports of a virtual robot, one per bus, inside a ``with`` block.

    In lock-step, only the traffic on the robot's last port advances time: that is where a driver
    writes its last goals.
    """

    def __init__(
        self,
        robot: VirtualRobot,
        *,
        time_mode: TimeMode,
        options: PortOptions | None = None,
    ) -> None:
        """Prepare the ports, each as a `VirtualBus` has it.

        With several ports, each gets ``-NAME`` appended to its link, and the schedule is for the
        last one.
        """
        options = options or PortOptions()
        *_, main = robot.chains
        self._robot, self._link = robot, None if options.link is None else Path(options.link)
        self._is_real_time = time_mode is TimeMode.REAL_TIME
        self.imu_line = self._make_imu_line()
        """The IMU's own serial port; None if it has none."""
        self.buses: dict[str, VirtualBus] = {}
        for name, chain in robot.chains.items():
            is_main = name == main
            own = replace(
                options,
                link=self._link_to(name) if len(robot.chains) > 1 else self._link,
                rng=options.rng.spawn(1)[0] if options.rng else None,
                schedule=options.schedule if is_main else None,
            )
            self.buses[name] = VirtualBus(
                chain,
                robot.physics,
                time_mode=time_mode,
                options=own,
                strict_stuffing=robot.quirks.strict_stuffing,
                advances_time=is_main or time_mode is TimeMode.REAL_TIME,
                line=self.imu_line if is_main else None,
            )
        self._open = ExitStack()

    @property
    def main(self) -> VirtualBus:
        """Return the bus that advances time."""
        return list(self.buses.values())[-1]

    @property
    def paths(self) -> dict[str, str]:
        """Return the path of each port by its name in robot.toml, that of the IMU included."""
        paths = {name: bus.path for name, bus in self.buses.items()}
        return paths | ({IMU_PORT: self.imu_line.path} if self.imu_line else {})

    @property
    def imu(self) -> ImuSource | None:
        """Return the source of a virtual IMU on I2C, which no other program can reach."""
        settings, chip = self._robot.robot.imu, self._robot.imu
        if settings is None or settings.is_serial:
            return None
        if not isinstance(chip, VirtualBno055 | VirtualBno08xI2c):
            return None
        return build_i2c_source(settings, chip)

    def __enter__(self) -> VirtualPorts:
        with ExitStack() as opening:
            if self.imu_line is not None:
                opening.callback(self.imu_line.close)  # after the bus that waits for it has ended
            for bus in self.buses.values():
                opening.enter_context(bus)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def _link_to(self, port: str) -> Path | None:
        """Return the path of one of several ports, None for a temporary one."""
        return self._link.with_name(f"{self._link.name}-{port}") if self._link else None

    def _make_imu_line(self) -> ImuLine | None:
        """Plug in the IMU's serial port, if it has one of its own."""
        imu = self._robot.imu
        if imu is None or isinstance(imu, VirtualBno08xI2c):
            return None
        if self._robot.robot.imu is None or not self._robot.robot.imu.is_serial:
            return None
        line = ImuLine(imu, link=self._link_to(IMU_PORT), repeats=not self._is_real_time)
        self._robot.on_imu_update = line.pass_on
        return line
