"""The serial ports of a virtual robot."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Self

from drivers.imu.build import build_i2c_source
from drivers.imu.source import ImuSource
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c
from drivers.virtual_bus.serving.imu_line import ImuLine
from drivers.virtual_bus.serving.server import PortOptions, TimeMode, VirtualBus
from drivers.virtual_bus.virtual_devices import VirtualDevices
from robots.imu import IMU_PORT


class VirtualPorts:
    """Serves the serial ports of a virtual robot, one per bus, inside a ``with`` block.

    In lock-step, only the traffic on the robot's last port advances time: that is where a driver
    writes its last goals.
    """

    def __init__(
        self,
        robot: VirtualDevices,
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
    def running(self) -> bool:
        """Return whether its ports are served."""
        return all(bus.running for bus in self.buses.values())

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

    def __enter__(self) -> Self:
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
