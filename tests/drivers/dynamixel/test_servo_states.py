"""What the driver knows of its servos: signs, units, and how far a reply is believed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_robots import with_servos

from drivers.dynamixel.protocol2 import Status
from drivers.dynamixel.requests import Replies
from drivers.dynamixel.servo_states import TORQUE, ServoStates
from robots.description.servo_catalog import servo_models

RPM = 2.0 * np.pi / 60.0
COUNTS = st.integers(-300, 300)
PERIOD = 0.008
BEGIN = 50.0  # s on the clock
REACH = 134  # ticks: 30, and 20 rad/s (13038 ticks/s) for one period


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


def test_torque_that_is_off_twice_in_a_row_is_a_restart_and_a_silence_may_be_one(states):
    update(states, reply(1, 2000), reply(2, 1000), now=BEGIN)
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
    for at, is_unsure in ((2.4, False), (5.0, True)):  # it was silent for so long
        update(states, reply(1, 2000), reply(2, 1000), now=BEGIN + at * PERIOD)
        assert states.is_unsure.tolist() == [False, is_unsure]


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


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("leap", "is_believed"), [(REACH, True), (REACH + 1, False)])
def test_a_position_further_than_any_joint_moves_is_not_believed(states, way, leap, is_believed):
    update(states, reply(1, 2000, 5, 7), reply(2, 1000), now=BEGIN)
    update(states, reply(1, 2000 + way * leap, 6, 8), reply(2, 1001), now=BEGIN + PERIOD)
    assert states.ticks.tolist() == [2000 + way * leap * is_believed, 1001]
    assert states.stamp.tolist() == [BEGIN + PERIOD * is_believed, BEGIN + PERIOD]
    assert states.velocity[0] == pytest.approx((5 + is_believed) * 0.229 * RPM)
    assert states.current[0] == pytest.approx((7 + is_believed) * 2.69e-3)


@pytest.mark.parametrize(("second", "is_confirmed"), [(REACH, True), (REACH + 1, False)])
def test_a_leap_is_believed_once_the_next_reply_confirms_it(states, second, is_confirmed):
    update(states, reply(1, 2000), reply(2, 1000), now=BEGIN)
    update(states, reply(1, 3500), now=BEGIN + PERIOD)
    update(states, reply(1, 3500 - second), now=BEGIN + 2 * PERIOD)
    assert states.ticks[0] == (3500 - second if is_confirmed else 2000)
    update(states, reply(1, 3500 - second + 10), now=BEGIN + 3 * PERIOD)
    assert states.ticks[0] == 3500 - second + 10


@pytest.mark.parametrize(
    ("zero", "before", "register", "ticks"),
    [
        # Turned by hand: the servo counted on while nothing read it.
        (2048, 1000, 4060, 4060),
        (2048, 2048, 4200, 4200),
        # A restart leaves what is within the first turn.
        (0, -300, 3796, -300),
        (0, 5, 4093, -3),
    ],
)
def test_a_joint_that_was_turned_or_restarts_is_where_it_was_or_can_be(
    tiny, zero, before, register, ticks
):
    states = ServoStates(with_servos(tiny, {"zero_ticks": zero}, {}), 0.008)
    update(states, reply(1, before), reply(2, 1000), now=BEGIN)
    update(states, reply(1, register), now=BEGIN + 10.0)
    assert states.ticks[0] == ticks


def torque_reply(*has_torque: int) -> Replies:
    statuses = [Status(k + 1, 0, bytes((torque,))) for k, torque in enumerate(has_torque)]
    return Replies.of(statuses, 1)


def test_torque_registers_are_compared_with_what_was_written(states):
    states.note_on(np.array([0]))
    assert states.update_torque(torque_reply(1, 0), is_final=True)
    flags = (states.must_release, states.must_seed, states.is_unsure)
    assert not np.array(flags).any()
    assert not states.update_torque(torque_reply(0, 1), is_final=False)
    assert [flag.tolist() for flag in flags] == [[False, True], [True, False], [False, False]]
    assert not states.update_torque(torque_reply(0, 0), is_final=True)
    assert states.is_unsure.tolist() == [True, False]
    states.note_off(np.array([1]))
    assert not states.must_release.any()
    states.update_background(1, TORQUE, b"\1")
    assert states.must_release.tolist() == [False, True], "where none was written"
    states.note_off(np.array([1]))
    states.update_background(1, TORQUE, b"\0")
    assert not states.must_release.any()


def test_a_servo_without_a_current_sensor_reports_its_load(tiny):
    """A count of load is 0.1 % of full load (e-manual, XL430), here of the stall current."""
    model = servo_models()["XL430-W250"]
    states = ServoStates(with_servos(tiny, {"model": model}), PERIOD)
    update(states, reply(1, 2000, 0, 500), reply(2, 1000, 0, 500))
    assert states.current == pytest.approx([0.5 * model.stall_current, -0.5 * model.stall_current])
