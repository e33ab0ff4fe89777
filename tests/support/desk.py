"""Servos on a bench, served on a virtual bus, for tests of `getup servo`."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from bus_stories import Served, serving

from drivers.dynamixel.bus import DynamixelBus
from drivers.service.loose_servo import open_bus
from robots.bench import ServoBench, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models

BAUD = 1_000_000
LIMITED = {"min_position_limit": 1024, "max_position_limit": 3072}
"""A quarter of a turn to each side."""


def make_desk(*servos: tuple[int, str], baud: int = BAUD) -> ServoBench:
    """Make a bench of servos, each an id and a model."""
    joints = [make_bench_joint(servo_models()[model], i) for i, model in servos]
    return make_bench(joints, baud=baud)


@contextmanager
def serving_desk(*servos: tuple[int, str], baud: int = BAUD) -> Iterator[Served]:
    """Serve servos that wait for their client; no wait for a reply ends by the clock."""
    desk = make_desk(*servos or ((1, "XL430-W250"), (3, "XM430-W350")), baud=baud)
    with serving(desk) as served, pytest.MonkeyPatch.context() as patch:
        patch.setattr("drivers.service.loose_servo.SerialPort", served.make_port)
        yield served


@contextmanager
def opening(served: Served, protocol: str | None = None) -> Iterator[DynamixelBus]:
    """Open the port of served servos, to look for those of a protocol, or of any."""
    with open_bus(served.path, BAUD, protocol) as bus:
        yield bus
