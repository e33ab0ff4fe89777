"""Messages of a live feed, each preceded by its length."""

from __future__ import annotations

import os
import socket
import stat
import struct
import tempfile
from pathlib import Path
from typing import TypeVar

import msgspec

from drivers.control_loop import Cycle
from drivers.errors import DriverError, SetupError
from drivers.safety_limits import find_max_temperature
from robots import Robot

STOP = b"S"
"""What a follower sends to stop the robot."""
MOST_BYTES = 1 << 20  # of a message
SUFFIX = ".feed"
LENGTH = struct.Struct("<I")
Message = TypeVar("Message", bound=msgspec.Struct)


class LiveHello(msgspec.Struct, frozen=True, kw_only=True):
    """First message: whose feed it is."""

    robot: str
    joint_names: tuple[str, ...]
    period: float
    """Control period [s]."""
    max_temperature: list[float]
    """Temperatures above which the guard releases the servos [°C], (n,)."""
    min_voltage: float
    """Supply below which it does [V]."""

    @classmethod
    def of(cls, robot: Robot) -> LiveHello:
        """Introduce a robot."""
        return cls(
            robot=robot.name,
            joint_names=tuple(robot.joint_names),
            period=robot.control_period,
            max_temperature=find_max_temperature(robot).tolist(),
            min_voltage=robot.supply_range[0],
        )


class LiveSample(msgspec.Struct, frozen=True, kw_only=True):
    """A control cycle."""

    phase: str
    """What the program is doing, such as planning."""
    cycle: int
    """Number of control cycles so far."""
    time: float
    """On the backend's clock [s]."""
    joint_pos: list[float]
    """Measured angles [rad], (n,)."""
    target: list[float]
    """Target angles that reached the servos [rad], (n,)."""
    torque_limit: list[float]
    """Torque limits that reached the servos, behind their gears [N·m], (n,)."""
    is_limp: bool
    """Whether every joint is released."""
    joint_current: list[float]
    """[A], (n,)"""
    temperature: list[float]
    """[°C], (n,)"""
    voltage: float
    """[V]"""
    orientation: list[float]
    """IMU frame to world, w x y z; empty without an IMU."""
    gyro: list[float]
    """Angular velocity in the IMU frame [rad/s]; empty without an IMU."""
    joint_age: list[float]
    """Age of each joint's angle and current [s], (n,)."""
    imu_age: float
    """Age of gyro and orientation [s]."""
    alert: list[int]
    """`HardwareError` bits of each servo, (n,); 0 for none."""
    clips: int
    """Number of commands that the guard has cut."""
    busy: float
    """Time to measure, decide and move in the cycle, in wall time [s]."""

    @classmethod
    def of(cls, cycle: Cycle, phase: str, number: int = 0) -> LiveSample:
        """Make the sample of a cycle in a phase; its number is 0 where cycles are not counted."""
        state, sent, timing = cycle.state, cycle.sent, cycle.timing
        return cls(
            phase=phase,
            cycle=number,
            time=float(state.time),
            joint_pos=state.joint_pos.tolist(),
            target=sent.joint_pos.tolist(),
            torque_limit=sent.torque_limit.tolist(),
            is_limp=sent.is_limp,
            joint_current=state.joint_current.tolist(),
            temperature=state.temperature.tolist(),
            voltage=float(state.voltage),
            orientation=state.orientation.tolist(),
            gyro=state.gyro.tolist(),
            joint_age=state.joint_age.tolist(),
            imu_age=float(state.imu_age),
            alert=state.alert.tolist(),
            clips=cycle.clips.total,
            busy=timing.read + timing.step + timing.write,
        )


class FeedError(DriverError):
    """A feed cannot be served or followed; the message is one line."""


class FeedFolderError(FeedError, SetupError):
    """The folder of the feeds cannot be used."""


def find_feeds_folder() -> Path:
    """Return the folder of this user's feeds, which no other user can enter.

    Raises:
        FeedFolderError: if another user made it.
    """
    folder = Path(tempfile.gettempdir(), f"getup-feeds-{os.getuid()}")
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if found.st_uid != os.getuid() or not stat.S_ISDIR(found.st_mode) or found.st_mode & 0o077:
        raise FeedFolderError(f"{folder}: expected a folder of this user alone; remove it")
    return folder


def send_message(connection: socket.socket, message: msgspec.Struct) -> None:
    """Send a message."""
    body = msgspec.msgpack.encode(message)
    connection.sendall(LENGTH.pack(len(body)) + body)


def receive_message(connection: socket.socket, kind: type[Message]) -> Message | None:
    """Receive a message; return None at the end of the feed.

    Raises:
        FeedError: if it is none of this kind.
    """
    if (head := _receive(connection, LENGTH.size)) is None:
        return None
    (length,) = LENGTH.unpack(head)
    if length > MOST_BYTES:
        raise FeedError(f"live feed: a message of {length} bytes, expected {MOST_BYTES} at most")
    if (body := _receive(connection, length)) is None:
        return None
    try:
        return msgspec.msgpack.decode(body, type=kind)
    except msgspec.DecodeError as error:
        raise FeedError(f"live feed: {error}") from error


def _receive(connection: socket.socket, count: int) -> bytes | None:
    """Receive a number of bytes; return None if the feed ends before."""
    parts = list[bytes]()
    while count:
        if not (part := connection.recv(count)):
            return None
        parts.append(part)
        count -= len(part)
    return b"".join(parts)
