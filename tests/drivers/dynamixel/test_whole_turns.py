"""The turns of servos that start within one turn are found by the ranges of their joints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memory_rig import Rig
from tiny_robots import with_servos

from drivers import Command
from drivers.dynamixel.whole_turns import WholeTurns
from drivers.servo_units import ServoUnits
from robots import Robot, load_robot
from robots.servo import TICKS_PER_TURN

SHARES = st.lists(st.floats(0.0, 1.0), min_size=30, max_size=30)


@pytest.fixture(scope="module")
def toddlerbot() -> Robot:
    return load_robot("toddlerbot")


def place(robot: Robot, shares: list[float]) -> np.ndarray:
    """Place joints within their ranges, clear of the angles that a start cannot tell apart."""
    lower, upper = np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0)
    waist = robot.joint_names.index("waist_yaw")
    lower[waist], upper[waist] = -0.9, 0.9
    return lower + (upper - lower) * np.array(shares)


@settings(max_examples=30, deadline=None)
@given(shares=SHARES, fall=st.integers(-300, 300))
def test_servos_start_where_their_joints_can_be_and_restart_near_to_where_they_were(
    toddlerbot, shares, fall
):
    """Also where the ranges alone cannot tell: the waist may be at either of its ends."""
    joint_pos = toddlerbot.lower + (toddlerbot.upper - toddlerbot.lower) * np.array(shares)
    for angles, is_new in ((joint_pos, False), (place(toddlerbot, shares), True)):
        true = ServoUnits(toddlerbot).to_ticks(angles)
        register = np.mod(true, TICKS_PER_TURN)
        near = register if is_new else true + fall
        assert np.array_equal(WholeTurns(toddlerbot).resolve(register, near), true)


def test_what_cannot_be_told_apart_is_listed(toddlerbot: Robot):
    """A turn of both servos is 2.62 rad of waist yaw: its ends are 3.14 rad apart."""
    waist, roll = (toddlerbot.joint_names.index(name) for name in ("waist_yaw", "waist_roll"))
    joint_pos = np.zeros(toddlerbot.n)
    joint_pos[waist] = 1.3
    ticks = ServoUnits(toddlerbot).to_ticks(joint_pos)
    found = WholeTurns(toddlerbot).find_angles(ticks, np.ones(toddlerbot.n, dtype=bool))
    assert found[waist] == pytest.approx([1.3, 1.3 - 2.0 * np.pi / 2.4], abs=0.001)
    assert found[roll] == pytest.approx(0.0, abs=0.001)
    assert all(len(found[row]) == 1 for row in range(toddlerbot.n) if row not in (waist, roll))
    known = np.ones(toddlerbot.n, dtype=bool)
    known[roll] = False  # the servo that the waist's yaw is coupled to
    assert len(WholeTurns(toddlerbot).find_angles(ticks, known)) == toddlerbot.n - 2


def test_a_servo_that_restarts_beyond_the_end_of_its_turn_is_still_measured_right(tiny: Robot):
    """In extended position mode, its register loses its turns by a restart."""
    with Rig(with_servos(tiny, {"zero_ticks": 100}, {}), limit_by="pwm") as rig:
        goal = Command.position(rig.robot, np.array([-0.5, 0.0]))
        before = rig.turn(goal, 100)
        assert rig.servo("l_hip").peek("present_position") < 0
        rig.servo("l_hip").reboot()
        after = rig.turn(goal, 120)
        assert rig.servo("l_hip").peek("present_position") > 0, "the test shows nothing"
        assert after.joint_pos == pytest.approx(before.joint_pos, abs=0.05)
        assert rig.peek("torque_enable") == [1, 1]


def test_a_joint_beyond_its_range_is_taken_at_the_nearer_end():
    """Wolfgang's shoulders turn almost right round: a register alone would put one at its other
    end."""
    wolfgang = load_robot("wolfgang")
    row = wolfgang.joint_names.index("RShoulderRoll")
    joint_pos = wolfgang.standing.joint_pos.copy()
    joint_pos[row] = wolfgang.upper[row] + 0.15
    true = ServoUnits(wolfgang).to_ticks(joint_pos)
    register = np.mod(true, TICKS_PER_TURN)
    found = ServoUnits(wolfgang).to_rad(WholeTurns(wolfgang).resolve(register, register))
    assert found == pytest.approx(joint_pos, abs=0.002)


# Ticks of encoders --------------------------------------------------------------------------------

ANGLES = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2)


@pytest.fixture(scope="module")
def units(tiny: Robot) -> ServoUnits:
    servos = ({"sign": 1, "zero_ticks": 2048}, {"sign": -1, "zero_ticks": 1000})
    return ServoUnits(with_servos(tiny, *servos))


@given(angles=ANGLES)
def test_quantized_angles_are_whole_ticks_and_half_a_tick_away_at_most(units: ServoUnits, angles):
    joint_pos = np.array(angles)
    quantized = units.quantize(joint_pos)
    assert np.abs(quantized - joint_pos).max() <= np.pi / 4096 + 1e-12
    fraction = units.to_fractional_ticks(quantized)
    assert fraction == pytest.approx(np.rint(fraction), abs=1e-6)
    assert np.array_equal(units.to_rad(units.to_ticks(joint_pos)), quantized)
