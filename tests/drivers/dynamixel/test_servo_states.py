"""What the driver knows of its servos: signs, units, and how far a reply is believed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.dynamixel.protocol2 import ALERT, Status
from drivers.dynamixel.requests import Replies
from drivers.dynamixel.servo_states import ERROR, SUPPLY, TORQUE, WATCHDOG, ServoStates

RPM = 2.0 * np.pi / 60.0
COUNTS = st.integers(-300, 300)


def reply(device: int, ticks: int, velocity: int = 0, current: int = 0, error: int = 0) -> Status:
    numbers = ((current, 2), (velocity, 4), (ticks, 4))
    data = b"".join(number.to_bytes(size, "little", signed=True) for number, size in numbers)
    return Status(device, error, data)


def update(states: ServoStates, *replies: Status, now: float = 0.0) -> None:
    states.update_cyclic(Replies.of(replies, 10), now)


@pytest.fixture
def states(tiny) -> ServoStates:
    return ServoStates(tiny, 0.008)


@given(velocity=COUNTS, current=COUNTS)
def test_velocity_and_current_have_the_sign_of_the_joint(tiny, velocity, current):
    """The right hip's servo is mounted the other way round: it turns the joint back as it counts.

    A count is 0.229 rpm of velocity and 2.69 mA of current (e-manual, XM430-W350).
    """
    states = ServoStates(tiny, 0.008)
    update(states, reply(1, 2048, velocity, current), reply(2, 1000, velocity, current))
    assert states.velocity == pytest.approx([0.229 * RPM * velocity, -0.229 * RPM * velocity])
    assert states.current == pytest.approx([2.69e-3 * current, -2.69e-3 * current])


def test_a_moving_joints_velocity_is_the_change_of_its_angle(tiny):
    states = ServoStates(tiny, 0.008)
    counts_per_turn, cycles = 4096, 50
    for cycle in range(cycles):
        # 30 rpm at the servo: 0.5 turns a second.
        ticks = round(0.5 * counts_per_turn * 0.008 * cycle)
        update(states, reply(1, 2048 + ticks, 131), reply(2, 1000 + ticks, 131), now=0.008 * cycle)
        angles = [j.servo.to_rad(int(t)) for j, t in zip(tiny.joints, states.ticks, strict=True)]
    mean = np.array(angles) / (0.008 * (cycles - 1))
    assert states.velocity == pytest.approx(mean, rel=0.01)
    assert states.velocity[0] > 0.0 > states.velocity[1]


def test_only_the_servo_that_replied_is_updated(states):
    update(states, reply(1, 2000), reply(2, 1000))
    update(states, reply(2, 1010, 7), now=0.008)
    assert states.ticks.tolist() == [2000, 1010]
    assert states.stamp.tolist() == [0.0, 0.008]
    assert states.velocity[0] == 0.0


def test_background_items_go_where_they_belong(states):
    states.update_background(1, SUPPLY, bytes((148, 0, 41)))
    assert (states.voltage[1], states.temperature[1]) == (14.8, 41.0)
    states.update_background(0, ERROR, bytes((0x20,)))
    assert states.alert.tolist() == [0x20, 0]
    states.update_background(0, ERROR, bytes((0,)))
    assert states.alert[0] == ALERT, "the cause of an alert is not yet known"
    states.note_on(np.array([0]))
    states.update_background(0, WATCHDOG, bytes((0xFF,)))
    states.update_background(1, WATCHDOG, bytes((0xFF,)))
    assert states.must_seed.tolist() == [True, False], "only under torque does a watchdog matter"


def test_torque_that_is_off_twice_in_a_row_is_a_restart_and_once_is_not(states):
    for row in (0, 1):
        states.note_ready(row)
    states.note_on(np.array([0, 1]))
    states.update_background(0, TORQUE, b"\0")
    assert states.is_unsure.tolist() == [True, False] and states.is_on.all()
    states.update_background(0, TORQUE, b"\1")
    states.update_background(0, TORQUE, b"\0")
    assert states.is_on.all(), "a reply in between tells that torque is on"
    states.update_background(0, TORQUE, b"\0")
    assert states.is_on.tolist() == [False, True]
    assert states.is_ready.tolist() == [False, True]


def test_torque_needs_a_servo_that_is_ready_fresh_and_unlocked(states):
    every, fresh = np.array([True, True]), np.array([True, False])
    assert not states.permit_torque(every, fresh, was_paused=False).any(), "none is ready"
    for row in (0, 1):
        states.note_ready(row)
    assert states.permit_torque(every, fresh, was_paused=False).tolist() == [True, False]
    states.note_on(np.array([0]))
    states.note_lost_port(np.array([0, 1]))
    for row in (0, 1):
        states.note_ready(row)
    assert states.permit_torque(every, every, was_paused=False).tolist() == [False, True]
    states.permit_torque(~every, every, was_paused=False)
    assert states.permit_torque(every, every, was_paused=False).all(), "released in between"
