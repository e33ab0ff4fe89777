"""Laws of the guard, against a backend that remembers what reaches it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nonempty import nonempty
from paths import TINY
from recording_backend import RecordingBackend, still_state

from drivers import Command, FaultKind, GuardLimits, SafetyGuard, Twin
from robots import Posture, load_robot
from robots.bench import Load, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.servo import RAD_PER_TICK

ROBOT = load_robot(TINY)
N = ROBOT.n
PERIOD = RecordingBackend.period
TWIN = Twin(ROBOT)
REACH = ROBOT.max_velocity[0] * PERIOD
"""Largest change of a target in a period [rad]."""
PATIENCE = GuardLimits.of(ROBOT).stale_writes

anything = st.floats() | st.floats(-5.0, 5.0)
"""Any float there is, NaN and infinities too, and often a plausible one."""


def vectors(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[np.ndarray]:
    return st.lists(numbers, min_size=N, max_size=N).map(np.array)


commands = st.builds(
    Command,
    joint_pos=vectors(anything),
    gain_scale=vectors(anything),
    torque_limit=vectors(anything | st.just(0.0)),
    pwm_limit=vectors(anything),
)
plausible = st.builds(
    Command,
    joint_pos=vectors(st.floats(-1e300, 1e300) | st.floats(-3.0, 3.0)),
    gain_scale=vectors(st.floats(-2.0, 2.0)),
    torque_limit=vectors(st.floats(0.0, 1e300) | st.sampled_from([0.0, 1.0])),
    pwm_limit=vectors(st.floats(-2.0, 2.0)),
)
cycles = st.lists(st.tuples(vectors(anything), commands | plausible), min_size=1, max_size=8)


def is_understood(command: Command, joint_pos: np.ndarray) -> bool:
    numbers = np.concatenate([*vars(command).values(), joint_pos])
    return bool(np.isfinite(numbers).all() and (command.torque_limit >= 0.0).all())


def check_laws(
    sent: Command, reference: np.ndarray, limits: GuardLimits, resolution: float = 0.0
) -> None:
    """The guard's laws, joint by joint, in plain arithmetic; servos round targets to ticks."""
    assert np.isfinite(np.concatenate(list(vars(sent).values()))).all()
    for i in range(N):
        assert 0.0 <= sent.torque_limit[i] <= limits.torque_limit[i]
        assert 0.0 <= sent.gain_scale[i] <= 1.0
        assert 0.0 <= sent.pwm_limit[i] <= 1.0
        if sent.torque_limit[i] == 0.0:
            continue
        target, ref = sent.joint_pos[i], reference[i]
        assert min(limits.lower[i], ref) <= target <= max(limits.upper[i], ref)
        rounding = 1e-12 * abs(ref) + resolution
        assert abs(target - ref) <= limits.max_velocity[i] * PERIOD + rounding + 1e-15


@given(cycles=cycles, cap=st.none() | st.floats(0.0, 10.0))
@settings(max_examples=150, deadline=None)
def test_no_command_from_any_state_passes_a_limit(cycles, cap):
    backend = RecordingBackend(ROBOT)
    guard = SafetyGuard(backend, GuardLimits.of(ROBOT, torque_limit=cap))
    last = Command.limp(N)
    healthy = True
    with guard:
        for joint_pos, command in nonempty(cycles):
            backend.state = replace(backend.state, joint_pos=joint_pos)
            guard.read()
            cuts_before = guard.clips.total
            sent = guard.write(command)
            assert sent is backend.received[-1]
            healthy = healthy and is_understood(command, joint_pos)
            assert sent.is_limp or healthy
            assert (guard.fault is None) == healthy
            check_laws(
                sent, np.where(last.torque_limit > 0, last.joint_pos, joint_pos), guard.limits
            )
            if healthy:
                held = command.torque_limit > 0.0
                changed = (
                    np.any((sent.joint_pos != command.joint_pos) & held)
                    or np.any(sent.gain_scale != command.gain_scale)
                    or np.any(sent.torque_limit != command.torque_limit)
                    or np.any(sent.pwm_limit != command.pwm_limit)
                )
                assert (guard.clips.total > cuts_before) == changed
            last = sent


@given(
    start=vectors(st.floats(-3.0, 3.0)),
    commands=st.lists(commands | plausible, min_size=1, max_size=12),
)
@settings(max_examples=60, deadline=None)
def test_no_command_drives_the_twin_beyond_a_limit(start, commands):
    TWIN.place(
        Posture(
            position=np.array([0.0, 0.0, 0.3]),
            orientation=np.array([1.0, 0.0, 0.0, 0.0]),
            joint_pos=start,
        )
    )
    limits = GuardLimits.of(ROBOT, torque_limit=1.5)
    guard = SafetyGuard(TWIN, limits)
    last = Command.limp(N)
    with guard:
        for command in nonempty(commands):
            measured = guard.read().joint_pos
            sent = guard.write(command)
            reference = np.where(last.torque_limit > 0, last.joint_pos, measured)
            check_laws(sent, reference, limits, resolution=RAD_PER_TICK)
            assert np.all(np.abs(TWIN.truth.joint_torque) <= limits.torque_limit)
            assert np.array_equal(TWIN.data.ctrl, sent.joint_pos)
            last = sent


@pytest.fixture
def backend():
    return RecordingBackend(ROBOT)


@pytest.fixture
def guard(backend):
    with SafetyGuard(backend) as guard:
        yield guard


def hold(angle: float) -> Command:
    return Command.position(ROBOT, np.full(N, angle))


def test_a_far_target_is_approached_at_top_speed_and_each_cut_is_counted(guard):
    step = 4.82 * 0.008  # no-load speed of the XM430 times the period
    sent = []
    for _ in range(3):
        guard.read()
        sent.append(guard.write(hold(0.1)).joint_pos)
    # 0.0386, 0.0771, then 0.1 is in reach: two cuts.
    assert sent == [
        pytest.approx([step, step]),
        pytest.approx([2 * step, 2 * step]),
        pytest.approx([0.1, 0.1]),
    ]
    assert guard.clips.velocity.tolist() == [2, 2]
    assert guard.clips.total == 4
    assert guard.clips.describe(ROBOT) == [
        "joint 'l_hip': velocity cut 2 times",
        "joint 'r_hip': velocity cut 2 times",
    ]


def test_a_fault_is_latched_until_cleared_and_clearing_without_one_keeps_the_last_target(guard):
    guard.read()
    guard.write(hold(0.03))
    guard.clear()
    guard.read()
    assert guard.write(hold(1.0)).joint_pos == pytest.approx([0.03 + REACH] * N)
    guard.read()
    assert guard.write(hold(np.nan)).is_limp
    for _ in range(3):
        guard.read()
        assert guard.write(hold(0.01)).is_limp
    assert guard.fault.kind is FaultKind.BAD_COMMAND
    assert str(guard.fault).count("l_hip") == str(guard.fault).count("r_hip") == 1
    guard.clear()
    guard.read()
    assert not guard.write(hold(0.01)).is_limp
    assert guard.fault is None


@pytest.mark.parametrize(
    ("bad", "culprit"),
    [
        (Command.position(ROBOT, np.array([0.0, np.inf])), "'r_hip': target is inf"),
        (replace(hold(0.0), torque_limit=np.array([-1.0, 1.0])), "'l_hip': torque limit is -1.0"),
        (replace(hold(0.0), gain_scale=np.array([1.0, np.nan])), "'r_hip': gain share is nan"),
        (Command.limp(3), "target has shape (3,), expected (2,)"),
    ],
)
def test_a_bad_command_is_a_fault_that_names_its_culprit(guard, bad, culprit):
    guard.read()
    assert guard.write(bad).is_limp
    assert culprit in guard.fault.detail


# Time, and the ends of ranges ---------------------------------------------------------------------


def make_guard(limits: GuardLimits | None = None, joint_pos: float = 0.0, time: float = 0.0):
    """Make a connected guard and its backend, whose clock is moved by hand."""
    backend = RecordingBackend(ROBOT)
    backend.clock_runs = False
    backend.state = still_state(ROBOT, joint_pos=np.full(ROBOT.n, joint_pos), time=time)
    guard = SafetyGuard(backend, limits)
    guard.connect()
    return guard, backend


def turn_at(guard: SafetyGuard, backend: RecordingBackend, target: float, time: float) -> Command:
    backend.state = replace(backend.state, time=time)
    guard.read()
    return guard.write(hold(target))


@given(steps=st.lists(st.floats(-1.0, 0.0), min_size=PATIENCE, max_size=3 * PATIENCE))
@settings(max_examples=60, deadline=None)
def test_a_clock_that_stands_still_or_runs_backwards_makes_the_robot_limp(steps):
    guard, backend = make_guard(time=10.0)
    assert not turn_at(guard, backend, 0.1, 10.0).is_limp
    times = 10.0 + np.cumsum(steps)
    limp = [turn_at(guard, backend, 0.1, time).is_limp for time in times]
    assert limp == [False] * (PATIENCE - 1) + [True] * (len(steps) - PATIENCE + 1)
    assert guard.fault is not None
    assert guard.fault.kind is FaultKind.STALE_DATA


@given(
    steps=st.lists(st.floats(-10.0, 1e6), min_size=1, max_size=20),
    target=st.floats(-20.0, 20.0) | st.floats(-1.2, 1.2),
)
@settings(max_examples=60, deadline=None)
def test_no_step_of_the_clock_lets_a_target_move_further_in_one_command(steps, target):
    guard, backend = make_guard()
    last = 0.0
    for time in nonempty(np.cumsum(steps)):
        sent = turn_at(guard, backend, target, time)
        if sent.is_limp:
            break
        if guard.fault is not None:  # a pause: held where it is, from then on
            last = backend.state.joint_pos
        assert np.abs(sent.joint_pos - last).max() <= (0.0 if guard.fault else REACH + 1e-12)
        last = sent.joint_pos


@given(
    start=st.floats(-4.0, 4.0),
    pushed=st.floats(-4.0, 4.0),
    targets=st.lists(st.floats(-20.0, 20.0) | st.floats(-1.2, 1.2), min_size=1, max_size=30),
)
@settings(max_examples=60, deadline=None)
def test_a_joint_outside_its_range_may_come_back_and_none_draws_its_target_out(
    start, pushed, targets
):
    guard, backend = make_guard(joint_pos=start)
    last = np.full(N, start)
    for cycle, target in nonempty(enumerate(targets)):
        sent = turn_at(guard, backend, target, 0.01 * cycle)
        assert not sent.is_limp, "outside is no fault: the robot must be able to come back"
        check_laws(sent, last, guard.limits)
        last = sent.joint_pos
        backend.state = replace(backend.state, joint_pos=np.full(N, pushed))


# Promised: a target never passes the end of its range, and comes near it no faster than the
# servo's top speed. Not promised: a limit of acceleration. A target at top speed stops at the end
# within one period, and the joint is braked by the servo, with the torque that it has.


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


@given(lower=st.floats(-4.0, 4.0), width=st.floats(0.0, 4.0))
@settings(max_examples=60, deadline=None)
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
        assert lower <= turn_at(guard, backend, 9.0, 0.0).joint_pos[1] <= upper
