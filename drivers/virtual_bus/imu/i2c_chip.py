"""What virtual IMU chips on an I2C bus share."""

from __future__ import annotations

from drivers.virtual_bus.imu.reading import ImuReading


class VirtualI2cChip:
    """A chip on an I2C bus, an `I2cChip` to the driver; it does not acknowledge without power."""

    path = "virtual I2C"

    def __init__(self) -> None:
        self.alive, self.frozen = True, False
        self._reading: ImuReading | None = None
        self.restart()

    def restart(self) -> None:
        """Lose power for a moment."""
        raise NotImplementedError

    def exchange(self, data: bytes, count: int) -> bytes:
        """Take what the host writes, then return as many bytes as it reads."""
        raise NotImplementedError

    def open(self) -> None:
        """Do nothing: its bus is there."""

    def close(self) -> None:
        """Do nothing."""

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        """Write bytes to the chip, then read some.

        Raises:
            OSError: if it has no power, as Linux reports a missing acknowledgement.
        """
        if not self.alive:
            raise OSError(121, "Remote I/O error")
        return self.exchange(data, count)
