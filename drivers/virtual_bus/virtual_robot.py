"""A whole virtual robot: its devices, and the simulation behind them."""

from __future__ import annotations

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.devices.quirks import Quirks
from drivers.virtual_bus.imu.reading import ImuReading
from drivers.virtual_bus.servo_physics import ServoPhysics
from drivers.virtual_bus.virtual_devices import FIRMWARE, VirtualDevices
from robots import Posture
from robots.imu import SensorAxes


class VirtualRobot(VirtualDevices):
    """The servos, the board and the IMU of a robot, with a simulation behind them."""

    def __init__(
        self,
        simulation: Simulation,
        *,
        firmware: int = FIRMWARE,
        powered: bool = False,
        quirks: Quirks | None = None,
    ) -> None:
        """Build the devices of a simulated robot; the parameters are those of `VirtualDevices`.

        Raises:
            SetupError: if the robot has no bus, or servos that cannot be driven.
        """
        super().__init__(simulation.robot, firmware=firmware, powered=powered, quirks=quirks)
        self.simulation = simulation
        self.physics: ServoPhysics = ServoPhysics(simulation, self.servos, self.board)
        if self.robot.imu is not None and self.imu is not None:
            self._imu_axes = SensorAxes.of(self.robot.imu.axes)
            simulation.on_sensor_update.append(self._sense_imu)
            self._sense_imu()

    def place(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off."""
        self._release()
        self.physics.place(posture)
        self._sense_imu()

    def hold(self, posture: Posture) -> None:
        """Place the robot at rest, cool, torque off, held by a person."""
        self._release()
        self.physics.hold(posture)
        self._sense_imu()

    def _release(self) -> None:
        for servo in self.servos:
            servo.poke("torque_enable", 0)

    def _sense_imu(self) -> None:
        if self.imu is not None:
            self.imu.sense(ImuReading.of(self.simulation, self._imu_axes, self.physics.time))
            self.on_imu_update()
