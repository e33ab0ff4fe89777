"""The serial port of a virtual IMU, served by the thread of the bus."""

from __future__ import annotations

from pathlib import Path

from drivers.virtual_bus.imu.virtual_imu import VirtualUartImu
from drivers.virtual_bus.serving.interfaces import SideLine
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal


class ImuLine(SideLine):
    """A pseudo-terminal in front of a virtual IMU; all methods are for the bus' thread."""

    def __init__(self, imu: VirtualUartImu, *, link: Path | None, repeats: bool) -> None:
        """Plug the port in.

        Args:
            imu: The sensor.
            link: Path of the port; None for a temporary one.
            repeats: Whether to send while time stands still, as it does in lock-step: a sensor's
                own clock does not.
        """
        self._imu, self._repeats = imu, repeats
        self._wire = PseudoTerminal(link)

    @property
    def path(self) -> str:
        """Return the path of the port."""
        return self._wire.path

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 while it is unplugged."""
        return self._wire.fileno()

    def serve(self) -> None:
        """Reply to what the client has sent."""
        self._wire.write(self._imu.receive(self._wire.read()))

    def pass_on(self) -> None:
        """Send what the sensor has sent by itself."""
        self._wire.write(self._imu.take())

    def idle(self) -> None:
        """Keep sending while the bus is idle, to a client that has read everything."""
        if self._repeats and self._wire.plugged and not self._wire.unread:
            self._wire.write(self._imu.repeat())

    def plug(self) -> None:
        """Plug the sensor's adapter in."""
        self._wire.plug()

    def unplug(self) -> None:
        """Unplug the sensor's adapter."""
        self._wire.unplug()

    def close(self) -> None:
        """Remove the port."""
        self._wire.close()
