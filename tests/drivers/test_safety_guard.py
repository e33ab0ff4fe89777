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
from robots.servo import RAD_PER_TICK

ROBOT = load_robot(TINY)
N = ROBOT.n
PERIOD = RecordingBackend.period
TWIN = Twin(ROBOT)

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


def test_torque_never_returns_with_a_jerk(guard, backend):
    for _ in range(5):
        guard.read()
        guard.write(hold(0.15))
    guard.read()
    guard.write(Command.limp(N))
    backend.state = replace(backend.state, joint_pos=np.array([-0.5, -0.5]))  # it fell
    guard.read()
    sent = guard.write(hold(0.15))
    assert sent.joint_pos == pytest.approx([-0.5 + 4.82 * 0.008] * 2)


def test_a_fault_is_latched_until_cleared(guard):
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


@pytest.mark.parametrize("field", ["joint_pos", "joint_vel", "joint_current", "temperature"])
def test_a_measurement_that_is_no_number_is_a_fault(guard, backend, field):
    backend.state = still_state(ROBOT, **{field: np.array([0.0, np.nan])})
    guard.read()
    assert guard.write(hold(0.0)).is_limp
    assert guard.fault.kind is FaultKind.BAD_MEASUREMENT
    assert guard.fault.detail == "joint 'r_hip'"


def test_clearing_without_a_fault_keeps_the_last_target(op3):
    twin = Twin(op3)
    guard = SafetyGuard(twin)
    with guard:
        guard.read()
        target = twin.truth.posture.joint_pos.copy()
        sent = guard.write(Command.position(op3, target))
        guard.clear()
        guard.read()
        far = guard.write(Command.position(op3, target + 0.5))
        reach = op3.max_velocity * guard.period
        assert np.all(np.abs(far.joint_pos - sent.joint_pos) <= reach + RAD_PER_TICK)
        assert guard.clips.total > 0
