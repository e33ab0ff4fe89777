"""A virtual robot: its servos, its board, its IMU, and the simulation behind them."""

from __future__ import annotations

from collections.abc import Callable

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.robot_ports import find_bus
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.board import VirtualBoard
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.device import Quirks
from drivers.virtual_bus.devices.plain_servo import PlainServo
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c
from drivers.virtual_bus.imu.virtual_imu import ImuReading, VirtualBno08xRvc, VirtualSerialLine
from drivers.virtual_bus.serving.exchange import Physics
from drivers.virtual_bus.servo_physics import HandledRobot, ServoPhysics
from robots import Robot
from robots.imu import ImuSettings

FIRMWARE = 46


class VirtualDevices:
    """The devices of a robot; what is behind them moves them."""

    physics: Physics
    """The physics behind them, which a subclass connects."""

    def __init__(
        self,
        robot: Robot,
        *,
        firmware: int = FIRMWARE,
        powered: bool = False,
        quirks: Quirks | None = None,
    ) -> None:
        """Build the devices of a robot, with one firmware version for all servos.

        ``powered`` says whether servos have power from the start, not only once the board switches
        it; ``quirks`` are None for the defaults.
        """
        self.robot = robot
        self.quirks = quirks = quirks or Quirks()
        self.bus = find_bus(robot)
        self.servos = [
            # With operating modes, profiles and a watchdog, or without.
            (VirtualServo if table_named(joint.servo.model.name).has_watchdog else PlainServo)(
                joint.servo.id,
                joint.servo.model.name,
                firmware=firmware,
                baud=self.bus.baud,
                quirks=quirks,
                stall_current=joint.servo.model.stall_current,
            )
            for joint in robot.joints
        ]
        self.board = self._build_board(powered)
        self.chains = {port: self._build_chain(port) for port in self.bus.ports}
        self.imu: AnyVirtualImu | None = None
        """The IMU, if it has a line of its own."""
        self.on_imu_update: Callable[[], None] = lambda: None
        """Called after each measurement of the IMU."""
        if robot.imu is not None and robot.imu.has_own_line:
            self.imu = build_virtual_imu(robot.imu)

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
        devices: list[VirtualServo | PlainServo | VirtualBoard] = [
            self.servos[names.index(joint)] for joint in self.bus.ports[port]
        ]
        if self.board and self.bus.board and self.bus.board.port == port:
            devices.append(self.board)
        return Chain(devices, self.quirks)


class VirtualRobot(VirtualDevices, HandledRobot):
    """The servos, the board and the IMU of a robot, with a simulation behind them."""

    def __init__(
        self,
        simulation: Simulation,
        *,
        firmware: int = FIRMWARE,
        powered: bool = False,
        quirks: Quirks | None = None,
    ) -> None:
        """Build the devices of a simulated robot; see `VirtualDevices`."""
        super().__init__(simulation.robot, firmware=firmware, powered=powered, quirks=quirks)
        self.simulation = simulation
        self.physics: ServoPhysics = ServoPhysics(simulation, self.servos, self.board)
        if self.imu is not None:
            simulation.on_sensor_update.append(self._sense_imu)
            self._sense_imu()

    def rearrange(self, change: Callable[[Simulation], None], *, releases: bool = False) -> None:
        """Change the simulation by hand."""
        if releases:
            for servo in self.servos:
                servo.poke("torque_enable", 0)
        self.physics.rearrange(change)
        if releases:
            self._sense_imu()

    def _sense_imu(self) -> None:
        if self.imu is not None:
            self.imu.sense(ImuReading.of(self.simulation, self.physics.time))
            self.on_imu_update()


AnyVirtualImu = VirtualBno055 | VirtualBno08xI2c | VirtualBno08xRvc | VirtualSerialLine


def build_virtual_imu(settings: ImuSettings) -> AnyVirtualImu:
    """Build the virtual counterpart of an IMU that is not on the servo bus."""
    if settings.kind == "bno055":
        return VirtualBno055()
    if settings.kind == "bno08x":
        return VirtualBno08xRvc() if settings.is_serial else VirtualBno08xI2c()
    return VirtualSerialLine(settings)
