"""What virtual servos did is counted: targets out of range, and the time until a robot is safe."""

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
    beyond = float(tiny.upper[1]) + 0.1
    rows = [(0.1 * k, ON, beyond) for k in range(3)]
    assert trace_of(virtual, *rows).count_beyond_limits() == 2  # the first has none before it
    limp = [(0.1 * k, OFF, beyond) for k in range(3)]
    assert trace_of(virtual, *limp).count_beyond_limits() == 0
    tick = float(tiny.upper[1]) + 0.9 * RAD_PER_TICK
    assert trace_of(virtual, *[(0.1 * k, ON, tick) for k in range(3)]).count_beyond_limits() == 0


def test_a_joint_out_of_its_range_may_be_held_where_it_is(virtual: VirtualRobot, tiny: Robot):
    out = float(tiny.lower[1]) - 0.2
    trace = trace_of(virtual, *[(0.1 * k, ON, out) for k in range(2)])
    assert trace.count_beyond_limits() == 1
    ticks = np.array([0.0, out])
    trace.snapshots = [
        ServoSnapshot(time=s.time, torque_on=s.torque_on, target=s.target, ticks=ticks)
        for s in trace.snapshots
    ]
    assert trace.count_beyond_limits() == 0


def test_every_run_of_physics_is_one_snapshot(tiny: Robot):
    virtual = VirtualRobot(Simulation(World(tiny)), powered=True)
    trace = ServoTrace(virtual.physics)
    for _ in range(3):
        virtual.physics.pass_period()
    times = [snapshot.time for snapshot in trace.snapshots]
    assert times == pytest.approx(np.arange(1, 4) * tiny.control_period)
    assert not any(snapshot.torque_on.any() for snapshot in trace.snapshots)
    np.testing.assert_allclose(trace.snapshots[0].ticks, 0.0, atol=2 * RAD_PER_TICK)
