"""Laws that ros2_control's joint limiters keep, of our guard.

Values that are no numbers, in commands and measurements, are in `test_safety_guard.py`: there the
limiters send such a command on, and our guard switches torque off.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nonempty import nonempty
from paths import TINY
from recording_backend import RecordingBackend, still_state

from drivers import Command, FaultKind, GuardLimits, SafetyGuard, Twin
from robots import load_robot
from robots.bench import Load, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.servo import RAD_PER_TICK

ROBOT = load_robot(TINY)
REACH = ROBOT.max_velocity[0] * RecordingBackend.period
"""Largest change of a target in a period [rad]."""
START, END = ROBOT.lower[0], ROBOT.upper[0]
"""The range of both joints [rad]."""
PATIENCE = GuardLimits.of(ROBOT).stale_writes

assert np.array_equal(ROBOT.lower, [START, START])
assert np.array_equal(ROBOT.upper, [END, END])

angles = st.floats(-20.0, 20.0) | st.floats(-1.2, 1.2)
laws = settings(max_examples=60, deadline=None)


def hold(angle: float) -> Command:
    return Command.position(ROBOT, np.full(ROBOT.n, angle))


def make_guard(limits: GuardLimits | None = None, joint_pos: float = 0.0, time: float = 0.0):
    """Make a connected guard and its backend, whose clock is moved by hand."""
    backend = RecordingBackend(ROBOT)
    backend.clock_runs = False
    backend.state = still_state(ROBOT, joint_pos=np.full(ROBOT.n, joint_pos), time=time)
    guard = SafetyGuard(backend, limits)
    guard.connect()
    return guard, backend


def turn(guard: SafetyGuard, backend: RecordingBackend, target: float, time: float) -> Command:
    """Run one cycle that measures at a time."""
    backend.state = replace(backend.state, time=time)
    guard.read()
    return guard.write(hold(target))


def compute_excess(joint_pos: np.ndarray | float) -> float:
    """Compute how far angles are outside the range [rad]; negative inside."""
    return float(np.maximum(START - joint_pos, joint_pos - END).max())


@given(steps=st.lists(st.floats(-1.0, 0.0), min_size=PATIENCE, max_size=3 * PATIENCE))
@laws
def test_a_clock_that_stands_still_or_runs_backwards_makes_the_robot_limp(steps):
    guard, backend = make_guard(time=10.0)
    assert not turn(guard, backend, 0.1, 10.0).is_limp
    times = 10.0 + np.cumsum(steps)
    limp = [turn(guard, backend, 0.1, time).is_limp for time in times]
    assert limp == [False] * (PATIENCE - 1) + [True] * (len(steps) - PATIENCE + 1)
    assert guard.fault is not None
    assert guard.fault.kind is FaultKind.STALE_DATA


@given(
    steps=st.lists(st.floats(-10.0, 1e6), min_size=1, max_size=20),
    target=angles,
)
@laws
def test_no_step_of_the_clock_lets_a_target_move_further_in_one_command(steps, target):
    guard, backend = make_guard()
    last = 0.0
    for time in nonempty(np.cumsum(steps)):
        sent = turn(guard, backend, target, time)
        if sent.is_limp:
            break
        if guard.fault is not None:  # a pause: held where it is, from then on
            last = backend.state.joint_pos
        assert np.abs(sent.joint_pos - last).max() <= (0.0 if guard.fault else REACH + 1e-12)
        last = sent.joint_pos


@given(
    start=st.floats(END, END + 3.0) | st.floats(START - 3.0, START),
    targets=st.lists(angles, min_size=1, max_size=30),
)
@laws
def test_a_joint_outside_its_range_stays_or_comes_back_and_never_goes_further_out(start, targets):
    guard, backend = make_guard(joint_pos=start)
    excess = compute_excess(start)
    for cycle, target in nonempty(enumerate(targets)):
        sent = turn(guard, backend, target, 0.01 * cycle)
        assert not sent.is_limp, "outside is no fault: the robot must be able to come back"
        assert compute_excess(sent.joint_pos) <= max(excess, 0.0)
        excess = compute_excess(sent.joint_pos)


@given(pushed=st.floats(END, END + 3.0), targets=st.lists(angles, min_size=1, max_size=20))
@laws
def test_a_joint_that_is_pushed_out_of_its_range_draws_no_target_after_it(pushed, targets):
    guard, backend = make_guard()
    turn(guard, backend, 0.0, 0.0)
    backend.state = replace(backend.state, joint_pos=np.full(ROBOT.n, pushed))
    for cycle, target in nonempty(enumerate(targets, start=1)):
        sent = turn(guard, backend, target, 0.01 * cycle)
        assert compute_excess(sent.joint_pos) <= 0.0


#
# Promised: a target never passes the end of its range, and comes near it no faster than the
# servo's top speed. Not promised: a limit of acceleration. A target at top speed stops at the end
# within one period, and the joint is braked by the servo, with the torque that it has.


@given(start=st.floats(START, END), targets=st.lists(angles, min_size=1, max_size=40))
@laws
def test_targets_near_the_end_of_a_range_no_faster_than_top_speed_and_never_pass_it(start, targets):
    guard, backend = make_guard(joint_pos=start)
    last = start
    for cycle, target in nonempty(enumerate(targets)):
        sent = turn(guard, backend, target, 0.01 * cycle).joint_pos
        assert compute_excess(sent) <= 0.0
        assert np.abs(sent - last).max() <= REACH + 1e-12
        last = sent


@pytest.mark.parametrize("load", [Load(), Load(mass=0.5, arm=0.15)], ids=["bare", "loaded"])
def test_a_servo_that_comes_at_top_speed_passes_the_end_of_its_range_by_a_tick_at_most(load):
    joint = make_bench_joint(servo_models()["XM430-W350"], 1)
    desk = make_bench([joint], baud=1_000_000, loads=[load])
    limits = replace(GuardLimits.of(desk), lower=np.array([-1.0]), upper=np.array([1.0]))
    states = []
    with SafetyGuard(Twin(desk, without_imu=True), limits) as guard:
        for _ in range(100):
            states.append(guard.read())
            guard.write(Command.position(desk, np.array([3.0])))
    farthest = max(state.joint_pos[0] for state in states)
    assert max(state.joint_vel[0] for state in states) > 0.9 * desk.max_velocity[0]
    assert 0.95 < farthest < 1.0 + RAD_PER_TICK


@given(
    lower=st.floats(-4.0, 4.0),
    width=st.floats(0.0, 4.0),
)
@laws
def test_a_range_is_taken_only_within_that_of_its_joint(lower, width):
    upper = lower + width
    limits = replace(
        GuardLimits.of(ROBOT), lower=np.array([-0.1, lower]), upper=np.array([0.1, upper])
    )
    if lower < ROBOT.lower[1] or upper > ROBOT.upper[1]:
        with pytest.raises(ValueError, match=r"guard limits: joint 'r_hip': .*expected a range"):
            make_guard(limits)
    else:
        guard, backend = make_guard(limits, joint_pos=lower)
        assert lower <= turn(guard, backend, 9.0, 0.0).joint_pos[1] <= upper
