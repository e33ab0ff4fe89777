"""CEVA BNO08x: orientation and acceleration by UART-RVC, or gyro and acceleration on I2C."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers.imu.fusion import GRAVITY
from drivers.imu.i2c import REMEDY, I2cChip
from drivers.imu.source import FIRST_SAMPLE, POLL_STEP, ImuError, ImuSample, ImuSource, SerialLink
from drivers.serial_port import SerialPort
from robots.imu import ImuSettings, SensorAxes
from robots.quaternion import Array

# Frame of 19 bytes (data sheet, 1.3.5.2): AA AA, index, yaw, pitch, roll [0.01 deg], acceleration
# x, y, z [0.001 g], three reserved bytes, and the sum of all after the header.
HEADER, FRAME_SIZE = b"\xaa\xaa", 19
BODY = struct.Struct("<B6h3x")
ANGLE_STEP = np.radians(0.01)  # rad
FORCE_STEP = GRAVITY / 1000.0  # m/s²
FRAME_PERIOD = 0.01  # s
INDICES = 256
MAX_GAP = 1.0  # s; the index repeats after 2.56 s


@dataclass(frozen=True, eq=False)
class RvcFrame:
    """One frame, in the sensor's axes."""

    index: int
    orientation: Array
    """Sensor frame to world, w x y z, shape (4,)."""
    accelerometer: Array
    """[m/s²], shape (3,)"""
    counts: bytes
    """All that is measured, without the index."""


def decode_frame(frame: bytes) -> RvcFrame | None:
    """Decode a frame of 19 bytes; None if its header or its checksum is wrong."""
    if frame[:2] != HEADER or sum(frame[2:-1]) % 256 != frame[-1]:
        return None
    index, *values = BODY.unpack(frame[2:-1])
    orientation = np.zeros(4)
    # Yaw first, then pitch and roll, each about the axis as already turned (data sheet).
    mujoco.mju_euler2Quat(orientation, np.array(values[:3]) * ANGLE_STEP, "zyx")
    return RvcFrame(
        index=index,
        orientation=orientation,
        accelerometer=np.array(values[3:]) * FORCE_STEP,
        counts=frame[3:15],
    )


class Bno08xRvc(ImuSource):
    """A BNO08x that sends frames by itself.

    It sends no gyro values. The mean rate between two orientations stands in for them, over the
    time between them by the frames' indices, so that no rotation is lost between two cycles.
    """

    note = "without gyro values: the rate is derived from consecutive orientations"

    def __init__(self, settings: ImuSettings, port: SerialPort) -> None:
        self.name = f"IMU BNO08x (UART-RVC) on {port.path}"
        self._link = SerialLink(port, self.name)
        self._axes = SensorAxes.of(settings.axes)
        self._buffer = b""
        self._last: RvcFrame | None = None
        self._now = self._last_at = 0.0

    def open(self) -> None:
        """Open the port."""
        self._link.open()
        self._buffer, self._last = b"", None

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def request(self, now: float) -> None:
        """Note the time: it sends by itself."""
        self._now = now

    def poll(self) -> ImuSample | None:
        """Return the sample between the last frame of the call before and the newest."""
        self._buffer += self._link.receive()
        newest = None
        for frame in self._cut():
            newest = frame
        if newest is None:
            return None
        last, gap = self._last, self._now - self._last_at
        self._last, self._last_at = newest, self._now
        if last is None or gap > MAX_GAP:
            return None
        frames = (newest.index - last.index) % INDICES
        return self._compare(last, newest, frames * FRAME_PERIOD) if frames else None

    def _compare(self, last: RvcFrame, newest: RvcFrame, duration: float) -> ImuSample:
        turn = np.zeros(3)
        mujoco.mju_subQuat(turn, newest.orientation, last.orientation)  # in the sensor's axes
        return ImuSample(
            gyro=self._axes.to_site(turn / duration),
            accelerometer=self._axes.to_site(newest.accelerometer),
            counts=newest.counts,
            duration=duration,
        )

    def _cut(self) -> list[RvcFrame]:
        """Take all whole frames from the buffer; skip other bytes."""
        frames = []
        while True:
            start = self._buffer.find(HEADER)
            if start < 0:
                self._buffer = self._buffer[-1:]
                return frames
            self._buffer = self._buffer[start:]
            if len(self._buffer) < FRAME_SIZE:
                return frames
            frame = decode_frame(self._buffer[:FRAME_SIZE])
            if frame is None:
                self.damaged += 1
                self._buffer = self._buffer[1:]
            else:
                frames.append(frame)
                self._buffer = self._buffer[FRAME_SIZE:]


# Packets of the sensor hub (SHTP): length with these four bytes, channel, sequence number. The
# highest bit of the length marks the rest of a packet that was read only in part.
PACKET = struct.Struct("<HBB")
CONTINUED, NO_PACKET = 0x8000, 0xFFFF
EXECUTABLE, CONTROL, REPORTS = 1, 2, 3  # channels
RESET_COMPLETE = 1  # on the executable channel
# Reports of the hub (SH-2).
ACCELEROMETER, GYRO, TIMEBASE, REBASE = 0x01, 0x02, 0xFB, 0xFA
PRODUCT_REQUEST, PRODUCT_RESPONSE, SET_FEATURE = 0xF9, 0xF8, 0xFD
REPORT_SIZES = {ACCELEROMETER: 10, GYRO: 10, TIMEBASE: 5, REBASE: 5}
FEATURE = struct.Struct("<BBBHIII")  # report, sensor, flags, sensitivity, interval, batch, config
INTERVAL_US = 5000  # of both sensors: 200 Hz
GYRO_STEP = 2.0**-9  # rad/s a count (Q9)
ACCELEROMETER_STEP = 2.0**-8  # m/s² a count (Q8)
MOST_PACKETS = 16  # read in one cycle
LONGEST_PACKET = 1024  # bytes; the longest, the advertisement, has about 280


class Bno08xI2c(ImuSource):
    """A BNO08x whose newest reports are read once a cycle.

    A report counts when its packet is whole and of a known kind; SHTP has no checksum on I2C.
    """

    def __init__(self, settings: ImuSettings, chip: I2cChip) -> None:
        self._chip = chip
        self.name = f"IMU BNO08x on {chip.path}"
        self._axes = SensorAxes.of(settings.axes)
        self._sent = [0] * 6  # packets on each channel
        self._product: bytes | None = None
        self._gyro = self._accelerometer = b""

    def open(self) -> None:
        """Open the bus, check the chip, and switch its reports on."""
        self._gyro = self._accelerometer = b""
        self._product = None
        try:
            self._chip.open()
            self._send(CONTROL, bytes([PRODUCT_REQUEST, 0]))
            self._await_product()
            self._set_features()
        except OSError as error:
            self._chip.close()
            raise ImuError(self.name, error.strerror or "silent", REMEDY) from error

    def close(self) -> None:
        """Close the bus."""
        self._chip.close()

    def poll(self) -> ImuSample | None:
        """Return the newest pair of reports, if a gyro report has arrived."""
        self._gyro = b""
        try:
            self._read_packets()
        except OSError:  # the chip does not acknowledge
            return None
        if not (self._gyro and self._accelerometer):
            return None
        gyro, accelerometer = (np.frombuffer(x, "<i2") for x in (self._gyro, self._accelerometer))
        return ImuSample(
            gyro=self._axes.to_site(gyro) * GYRO_STEP,
            accelerometer=self._axes.to_site(accelerometer) * ACCELEROMETER_STEP,
            counts=self._gyro + self._accelerometer,
        )

    def _await_product(self) -> None:
        until = time.monotonic() + FIRST_SAMPLE
        while self._product is None:
            self._read_packets()
            if self._product is None and time.monotonic() > until:
                self._chip.close()
                remedy = "expected a BNO08x: check its address and its mode pins (PS0, PS1)"
                raise ImuError(self.name, "does not identify itself", remedy)
            time.sleep(0.0 if self._product else POLL_STEP)

    def _read_packets(self) -> None:
        for _ in range(MOST_PACKETS):
            length = PACKET.unpack(self._chip.transfer(b"", PACKET.size))[0]
            size = length & ~CONTINUED
            if length == NO_PACKET or size <= PACKET.size:
                return
            if size > LONGEST_PACKET:
                self.damaged += 1
                return
            self._take(self._chip.transfer(b"", size), size)

    def _take(self, packet: bytes, size: int) -> None:
        length, channel, _ = PACKET.unpack(packet[: PACKET.size])
        cargo = packet[PACKET.size :]
        if length & ~CONTINUED != size or not cargo:
            self.damaged += 1
        elif channel == EXECUTABLE and cargo[0] == RESET_COMPLETE:
            self._set_features()  # it has restarted
        elif channel == CONTROL and cargo[0] == PRODUCT_RESPONSE:
            self._product = cargo
        elif channel == REPORTS:
            for kind, values in self._cut(cargo):
                if kind == GYRO:
                    self._gyro = values
                elif kind == ACCELEROMETER:
                    self._accelerometer = values

    def _cut(self, cargo: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield kind and values of each report; one of unknown size ends the packet."""
        while cargo:
            size = REPORT_SIZES.get(cargo[0])
            if size is None or size > len(cargo):
                self.damaged += 1
                return
            yield cargo[0], cargo[4:size]  # after the kind, sequence number, status and delay
            cargo = cargo[size:]

    def _set_features(self) -> None:
        for sensor in (ACCELEROMETER, GYRO):
            self._send(CONTROL, FEATURE.pack(SET_FEATURE, sensor, 0, 0, INTERVAL_US, 0, 0))

    def _send(self, channel: int, cargo: bytes) -> None:
        header = PACKET.pack(PACKET.size + len(cargo), channel, self._sent[channel] % 256)
        self._sent[channel] += 1
        self._chip.transfer(header + cargo)
