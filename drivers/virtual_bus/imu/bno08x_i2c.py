"""A virtual BNO08x on I2C: packets of its sensor hub."""

from __future__ import annotations

import struct
from collections import deque

from drivers.virtual_bus.imu.virtual_imu import ImuReading, VirtualI2cChip, to_counts

# All numbers here are those of the manuals of SHTP and SH-2 (CEVA), none is the driver's.
PACKET = struct.Struct("<HBB")  # length, channel, sequence number
CONTINUED = 0x8000
EXECUTABLE, CONTROL, REPORTS = 1, 2, 3  # channels
RESET_COMPLETE = 1
PRODUCT_REQUEST, PRODUCT_RESPONSE, SET_FEATURE = 0xF9, 0xF8, 0xFD
TIMEBASE, ACCELEROMETER, GYRO = 0xFB, 0x01, 0x02
STEPS = {ACCELEROMETER: 2.0**-8, GYRO: 2.0**-9}  # m/s² and rad/s a count: Q points 8 and 9
FEATURE = struct.Struct("<BBBHIII")  # the fifth is the interval [µs]
ACCURATE = 3  # status of a report
ROUNDING = 1e-9  # s; bus times are sums of periods
KEPT = 8  # packets that wait for the host; older reports are dropped
# Version 3.2, part, build and patch numbers as an example; 16 bytes (SH-2).
PRODUCT = struct.pack("<BBBBIIHH", PRODUCT_RESPONSE, 1, 3, 2, 10003608, 370, 7, 0)


class VirtualBno08xI2c(VirtualI2cChip):
    """Queues packets, of which the host reads as many bytes as it likes.

    As on the chip, every read begins with a header; the rest of a packet that was read in part
    follows with the next one, marked as a continuation.
    """

    def restart(self) -> None:
        """Lose power for a moment: no feature is on, and the hub says that it has started."""
        self._intervals: dict[int, float] = {}  # s between two reports of a sensor that is on
        self._due: dict[int, float] = {}  # bus time of the next [s]
        self._sent = [0] * 6
        self._reports = 0
        self._now = 0.0
        self._rest: tuple[int, int, bytes] | None = None
        self._packets: deque[tuple[int, bytes]] = deque([(EXECUTABLE, bytes([RESET_COMPLETE]))])

    def sense(self, reading: ImuReading) -> None:
        """Take a measurement, and queue the reports that are due."""
        self._now = reading.time
        if not self.frozen:
            self._reading = reading
        self._report()

    def exchange(self, data: bytes, count: int) -> bytes:
        """Take a packet from the host, then return bytes of the next one."""
        if data:
            self._execute(data[PACKET.size :])
        return self._read_out(count) if count else b""

    def _execute(self, cargo: bytes) -> None:
        """Execute what a packet says; the hub ignores what it does not know."""
        kind = cargo[0] if cargo else None
        if kind == PRODUCT_REQUEST:
            self._packets.append((CONTROL, PRODUCT))
        elif kind == SET_FEATURE and len(cargo) == FEATURE.size:
            _, sensor, _, _, interval, _, _ = FEATURE.unpack(cargo)
            self._intervals[sensor], self._due[sensor] = interval * 1e-6, self._now
            if not interval:
                del self._intervals[sensor]
            self._report()

    def _report(self) -> None:
        """Queue a packet of what is due; a sensor that is faster than the bus reports each time."""
        if self._reading is None:
            return
        values = {ACCELEROMETER: self._reading.accelerometer, GYRO: self._reading.gyro}
        cargo = b""
        for sensor in sorted(self._intervals.keys() & values.keys()):
            if self._now < self._due[sensor] - ROUNDING:
                continue
            self._due[sensor] = max(self._due[sensor] + self._intervals[sensor], self._now)
            head = bytes([sensor, self._reports % 256, ACCURATE, 0])
            cargo += head + to_counts(values[sensor], STEPS[sensor])
        if not cargo:
            return
        cargo = struct.pack("<Bi", TIMEBASE, 0) + cargo
        self._reports += 1
        waiting = [packet for packet in self._packets if packet[0] == REPORTS]
        if len(waiting) >= KEPT:
            self._packets.remove(waiting[0])
        self._packets.append((REPORTS, cargo))

    def _read_out(self, count: int) -> bytes:
        continued = self._rest is not None
        if self._rest is None:
            if not self._packets:
                return bytes(count)
            channel, cargo = self._packets.popleft()
            self._rest = channel, self._sent[channel] % 256, cargo
            self._sent[channel] += 1
        channel, sequence, cargo = self._rest
        length = PACKET.size + len(cargo) | (CONTINUED if continued else 0)
        room = max(count - PACKET.size, 0)
        handed, left = cargo[:room], cargo[room:]
        self._rest = (channel, sequence, left) if left else None
        return (PACKET.pack(length, channel, sequence) + handed)[:count].ljust(count, b"\0")
