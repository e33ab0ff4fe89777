"""What virtual servos did is counted: targets out of range, and the time until a robot is safe."""

from dataclasses import replace

import numpy as np
import pytest
from checked_driver import ServoSnapshot, ServoTrace

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.servo import RAD_PER_TICK

OFF, ON = (False, False), (True, True)


@pytest.fixture(scope="module")
def virtual(tiny: Robot) -> VirtualRobot:
    return VirtualRobot(Simulation(World(tiny)), powered=True)


def trace_of(virtual: VirtualRobot, *rows: tuple[float, tuple[bool, bool], float]) -> ServoTrace:
    """Trace snapshots (time, torque on, target of the second servo) of joints that rest at 0."""
    trace = ServoTrace(virtual.physics)
    trace.snapshots = [
        ServoSnapshot(
            time=time, torque_on=np.array(on), target=np.array([0.0, target]), ticks=np.zeros(2)
        )
        for time, on, target in rows
    ]
    return trace


@pytest.mark.parametrize(
    ("rows", "safe"),
    [
        ([(1.0, ON, 0.1), (1.1, ON, 0.2), (1.2, OFF, 0.2), (1.3, OFF, 0.9)], 0.1),  # off in the end
        ([(1.0, ON, 0.1), (1.1, ON, 0.2), (1.2, ON, 0.3), (1.3, ON, 0.3)], 0.2),  # it holds
        ([(1.0, ON, 0.1), (1.1, ON, 0.1), (1.2, ON, 0.1)], 0.0),  # and did from the start
        ([(1.0, ON, 0.1), (1.1, ON, 0.2), (1.2, ON, 0.3)], None),  # it moves on
        ([(1.0, OFF, 0.1), (1.1, OFF, 0.1), (1.2, ON, 0.1)], None),  # torque comes back
        ([(0.5, ON, 0.1), (0.9, ON, 0.7), (1.2, ON, 0.7), (1.3, ON, 0.7)], 0.2),  # 1 s counts
    ],
)
def test_a_robot_is_safe_from_where_its_torque_is_off_or_its_targets_stay(virtual, rows, safe):
    found = trace_of(virtual, *rows).find_safe_time(1.0 - 1e-9)
    assert found == (None if safe is None else pytest.approx(safe, abs=1e-6))


def test_targets_out_of_range_count_while_torque_is_on(virtual: VirtualRobot, tiny: Robot):
    """A joint that is out of its range may be held where it is."""

    def count(on: tuple[bool, bool], target: float) -> int:
        return trace_of(virtual, *[(0.1 * k, on, target) for k in range(3)]).count_beyond_limits()

    beyond = float(tiny.upper[1]) + 0.1
    assert count(ON, beyond) == 2  # the first has none before it
    assert count(OFF, beyond) == 0
    assert count(ON, float(tiny.upper[1]) + 0.9 * RAD_PER_TICK) == 0
    trace = trace_of(virtual, *[(0.1 * k, ON, beyond) for k in range(3)])
    trace.snapshots = [replace(s, ticks=np.array([0.0, beyond])) for s in trace.snapshots]
    assert trace.count_beyond_limits() == 0
