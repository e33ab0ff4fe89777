"""The serial ports of a virtual robot."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Self

from drivers.imu.build import build_i2c_source
from drivers.imu.source import ImuSource
from drivers.serial_port import PortLostError, SerialPort
from drivers.virtual_bus.imu.virtual_imu import VirtualI2cChip, VirtualUartImu
from drivers.virtual_bus.serving.server import PortOptions, TimeMode, VirtualBus
from drivers.virtual_bus.serving.side_lines import I2cLine, ImuLine, SideLine
from drivers.virtual_bus.virtual_robot import VirtualDevices
from robots.imu import IMU_PORT

POLL = 0.002  # s between two looks whether the bus is done
LONGEST = 5.0  # s for which a bus may handle what was written, or bytes may be on their way


class VirtualPorts:
    """Serves the serial ports of a virtual robot, one per bus, inside a ``with`` block.

    In lock-step, only the traffic on the robot's last port advances time: that is where a driver
    writes its last goals.
    """

    def __init__(
        self, robot: VirtualDevices, *, time_mode: TimeMode, options: PortOptions | None = None
    ) -> None:
        """Prepare the ports, each as a `VirtualBus` has it.

        With several ports, each gets ``-NAME`` appended to its link.
        """
        options = options or PortOptions()
        *_, main = robot.chains
        self._robot, self._link = robot, None if options.link is None else Path(options.link)
        self._is_real_time = time_mode is TimeMode.REAL_TIME
        self.imu_line = self._make_imu_line()
        """The IMU's own serial port or I2C bus; None if it has none."""
        self.buses: dict[str, VirtualBus] = {}
        for name, chain in robot.chains.items():
            is_main = name == main
            own = replace(
                options,
                link=self._link_to(name) if len(robot.chains) > 1 else self._link,
            )
            self.buses[name] = VirtualBus(
                chain,
                robot.physics,
                time_mode=time_mode,
                options=own,
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
        """Return the source of an IMU on I2C that keeps step with its client; None without one.

        In real time there is none: a driver reads the chip at its path.
        """
        settings, chip = self._robot.robot.imu, self._robot.imu
        if self._is_real_time or settings is None or settings.is_serial:
            return None
        return build_i2c_source(settings, chip) if isinstance(chip, VirtualI2cChip) else None

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

    def make_port(self, path: str, baud: int) -> SerialPort:
        """Make the client's end of a port, for a driver in this process.

        In lock-step no time of the wall decides whether a reply is missing.
        """
        if self._is_real_time:
            return SerialPort(path, baud)
        bus = next(bus for bus in self.buses.values() if bus.path == path)
        return LockStepPort(path, baud, bus)

    def _link_to(self, port: str) -> Path | None:
        """Return the path of one of several ports, None for a temporary one."""
        return self._link.with_name(f"{self._link.name}-{port}") if self._link else None

    def _make_imu_line(self) -> SideLine | None:
        """Plug in the IMU's serial port or I2C bus, if it has one of its own."""
        settings, imu = self._robot.robot.imu, self._robot.imu
        link = self._link_to(IMU_PORT)
        if settings is None:
            return None
        if isinstance(imu, VirtualI2cChip) and not settings.is_serial:
            return I2cLine(imu, settings.address, link=link)
        if not isinstance(imu, VirtualUartImu):
            return None
        line = ImuLine(imu, link=link, repeats=not self._is_real_time)
        self._robot.on_imu_update = line.pass_on
        return line


class LockStepPort(SerialPort):
    """A serial port on which a reply is missing once the bus has done all that was written.

    No time of the wall ends a read, so that neither a busy computer loses a reply, nor is anything
    waited for that does not come.
    """

    def __init__(self, path: str, baud: int, bus: VirtualBus) -> None:
        super().__init__(path, baud)
        self._bus = bus
        self._written = self._received = 0

    def open(self) -> None:
        """Open and lock the device; harmless if it is open."""
        if self.is_open:
            return
        super().open()
        self._written, self._received = self._bus.handled, self._bus.delivered

    def close(self) -> None:
        """Unlock and close the device, once the bus has handled what was written."""
        until = time.monotonic() + LONGEST
        while self.is_open and not self._is_handled() and time.monotonic() < until:
            time.sleep(POLL)
        super().close()

    def write(self, data: bytes) -> None:
        """Pass bytes to the bus."""
        self._written += len(data)
        with self._forgetting_what_is_lost():
            super().write(data)

    def read(self, deadline: float) -> bytes:  # noqa: ARG002
        """Return received bytes; wait for one until the bus is done, whatever the deadline."""
        until = time.monotonic() + LONGEST
        while True:
            is_done = self._is_done()
            with self._forgetting_what_is_lost():
                data = super().read(0.0 if is_done else time.monotonic() + POLL)
            self._received += len(data)
            if data or is_done or time.monotonic() > until:
                return data

    def flush(self) -> int:
        """Drop received bytes; return their number."""
        with self._forgetting_what_is_lost():
            count = super().flush()
        self._received += count
        return count

    @contextmanager
    def _forgetting_what_is_lost(self) -> Iterator[None]:
        """Expect no more of the bus once its port was unplugged."""
        try:
            yield
        except PortLostError:
            self._written = self._bus.handled
            raise

    def _is_done(self) -> bool:
        """Return whether the bus has handled all bytes, and all of its own have come; or ended."""
        has_all = self._received >= self._bus.delivered or not self._bus.running
        return self._is_handled() and has_all

    def _is_handled(self) -> bool:
        """Return whether the bus has handled all bytes that were written, or has ended."""
        return self._bus.handled >= self._written or not self._bus.running
