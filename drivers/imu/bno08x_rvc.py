"""CEVA BNO08x in its UART-RVC mode: orientation and acceleration, 100 times a second."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import mujoco
import numpy as np

from drivers.imu.fusion import GRAVITY
from drivers.imu.source import ImuSample, ImuSource, SerialLink
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
