"""Rows that another process publishes: whole, in order, and never waited for."""

from collections.abc import Callable

import numpy as np
import pytest
from nonempty import nonempty

from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo
from drivers.virtual_bus.imu.virtual_imu import ImuReading
from drivers.virtual_bus.own_process import shared_rows
from drivers.virtual_bus.own_process.shared_rows import SLOTS, Measurements, SharedRows
from robots.quaternion import Array


class OvertakenRows:
    """The rows of a reader that is interrupted once, with half of a row copied."""

    def __init__(self, rows: Array, interrupt: Callable[[], None]) -> None:
        self._rows, self._interrupt = rows, interrupt

    def __getitem__(self, place: int) -> "OvertakenRows":
        self._slot = self._rows[place]
        return self

    def copy(self) -> Array:
        half = self._slot[: len(self._slot) // 2].copy()
        interrupt, self._interrupt = self._interrupt, lambda: None
        interrupt()
        return np.concatenate([half, self._slot[len(half) :]])


def read_overtaken(came: int, *, is_counted: bool) -> tuple[int, Array] | None:
    """Read while some rows come, the last of them counted already or not."""
    writer = SharedRows(4)
    reader = SharedRows(4, writer.descriptor)

    def write_on() -> None:
        for _ in range(came):
            writer.publish(np.full(4, writer._count[0] + 1.0))
        writer._count[0] -= not is_counted

    writer.publish(np.ones(4))
    rows = OvertakenRows(reader._rows, write_on)
    reader._rows = rows  # pyright: ignore[reportAttributeAccessIssue]
    found = reader.read(after=0)
    writer.close()
    return found


@pytest.mark.parametrize("is_counted", [True, False])
def test_a_reader_that_the_writer_overtakes_gets_a_whole_row(*, is_counted: bool):
    for came in nonempty(range(1, 2 * SLOTS + 2)):
        found = read_overtaken(came, is_counted=is_counted)
        assert found is not None
        assert found[1].tolist() == [float(found[0])] * 4, f"{came} rows came"


def test_commands_of_motors_survive_a_row():
    servos = [VirtualServo(1), VirtualServo(2, "XL430-W250")]
    servos[0].poke("torque_enable", 1)
    servos[0].poke("goal_position", 3000)
    commands = [servo.motor_command() for servo in servos]
    row = shared_rows.write_commands(commands, [True, False])
    assert row.shape == (shared_rows.count_commands(2),)
    assert shared_rows.read_commands(row) == [(commands[0], True), (commands[1], False)]


@pytest.mark.parametrize("has_imu", [True, False])
def test_measurements_survive_a_row(has_imu: bool):
    rng = np.random.default_rng(0)
    servos = [Measured(*rng.normal(size=6).tolist()) for _ in range(3)]
    gyro, force = rng.normal(size=3), rng.normal(size=3)
    imu = ImuReading(0.25, *(rng.normal(size=n) for n in (3, 3, 4))) if has_imu else None
    body = {"voltage": 11.5, "gyro": gyro, "accelerometer": force}
    row = Measurements(servos=servos, **body, imu=imu).write()
    assert row.shape == (shared_rows.count_measurements(3),)
    found = Measurements.read(row)
    assert (found.servos, found.voltage) == (servos, 11.5)
    assert np.array_equal(found.gyro, gyro) and np.array_equal(found.accelerometer, force)
    assert (found.imu is not None) == has_imu
    if imu is not None and found.imu is not None:
        for name in ("time", "gyro", "accelerometer", "orientation"):
            assert np.array_equal(getattr(found.imu, name), getattr(imu, name))
