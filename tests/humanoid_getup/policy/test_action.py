"""What a policy sees, and what its numbers become: joint targets within limits, reach and lead."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.policy.action import (
    ActionMode,
    ActionSpec,
    StanceScaling,
    between,
    build_action_spec,
    choose_actions,
    next_target,
)
from humanoid_getup.policy.observation import (
    VECTOR,
    Sensed,
    compute_torque_share,
    list_terms,
    observe,
)
from robots import Robot, load_robot

OP3 = load_robot("op3")
SPEC = choose_actions(OP3, wide=True)
SEEDS = st.integers(0, 2**32 - 1)
MODES = st.sampled_from(list(ActionMode))


def spec_of(mode: ActionMode) -> ActionSpec:
    return replace(SPEC, mode=mode)


Sample = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
UPRIGHT, SUPINE = np.array([0.0, 0.0, -1.0]), np.array([-1.0, 0.0, 0.0])


def sample(seed: int, count: int = 8) -> Sample:
    """Sample targets, measured angles near them, ways down, and actions beyond -1 to 1, too."""
    rng = np.random.default_rng(seed)
    target = rng.uniform(OP3.lower, OP3.upper, (count, OP3.n))
    measured = target + rng.normal(0.0, 0.5, target.shape)
    down = rng.normal(size=(count, 3))
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    return target, measured, down, rng.uniform(-1.5, 1.5, (count, SPEC.size))


@given(seed=SEEDS, mode=MODES)
def test_mirrored_numbers_make_mirrored_targets(seed: int, mode: ActionMode):
    target, measured, down, action = sample(seed)
    spec, mirror = spec_of(mode), OP3.mirror_joints
    following = next_target(OP3, spec, target, measured, down, action)
    other = (mirror(target), mirror(measured), VECTOR(down), action * spec.mirror_sign(OP3))
    assert next_target(OP3, spec, *other) == pytest.approx(mirror(following))


@given(seed=SEEDS, mode=MODES)
def test_a_target_keeps_to_its_reach_range_and_lead_or_comes_back_as_fast_as_it_can(
    seed: int, mode: ActionMode
):
    target, measured, down, action = sample(seed)
    following = next_target(OP3, spec_of(mode), target, measured, down, action)
    assert np.all(np.abs(following - target) <= SPEC.reach + 1e-12)
    assert np.all((following >= OP3.lower - 1e-12) & (following <= OP3.upper + 1e-12))
    nearest = np.clip(measured, OP3.lower, OP3.upper)  # a target may not leave its range for it
    ahead = np.abs(following - nearest) > SPEC.lead + 1e-12
    came_back = np.abs(target - nearest) - np.abs(following - nearest)
    assert ahead.any()
    assert came_back[ahead] == pytest.approx(np.broadcast_to(SPEC.reach, ahead.shape)[ahead])


def test_a_joint_that_comes_home_can_be_held_off_when_fallen_but_not_for_good_when_standing():
    spec = build_action_spec(OP3, ("l_hip_roll",), homing=("l_hip_roll",))
    joint, home = OP3.joint_names.index("l_hip_roll"), OP3.standing.joint_pos
    for gravity, spread in ((SUPINE, OP3.upper[joint] - home[joint]), (UPRIGHT, 0.0)):
        target = home.copy()
        for _ in range(200):
            target = next_target(OP3, spec, target, target, gravity, np.ones(1))
        assert target[joint] - home[joint] == pytest.approx(spread, abs=0.2)


def test_a_number_is_added_to_what_the_mode_says():
    one = np.ones(OP3.n)
    spec = replace(SPEC, names=("hinge",), directions=one[None], scale=0.1 * one, reach=one)
    spec = replace(spec, lead=0.6, home=0.25 * one, homing=0.0 * one)
    for mode, wanted in (
        (ActionMode.RATE, 0.30 + 0.05),  # the last target and a half of 0.1
        (ActionMode.OFFSET, 0.20 + 0.05),  # the measured angle and a half of 0.1
        (ActionMode.ABSOLUTE, 0.25 + 0.05),  # home and a half of 0.1
    ):
        made = replace(spec, mode=mode)
        following = next_target(OP3, made, 0.3 * one, 0.2 * one, SUPINE, np.array([0.5]))
        assert following == pytest.approx(np.clip(wanted, OP3.lower, OP3.upper))


def test_rates_slow_down_upright_and_near_home():
    """Nothing below the least; half of a tilt or 0.6 of a way; what asks for more counts."""
    calm = StanceScaling(tilt=0.5, away=0.5, least=0.2)
    for tilt, offset, share in (
        *((0.0, 0.0, 0.2), (0.25, 0.0, 0.5), (0.0, -0.3, 0.6)),
        *((0.25, 0.1, 0.5), (1.6, 0.0, 1.0), (0.0, 2.0, 1.0)),
    ):
        for direction in (0.0, 2.0):  # falling forwards, or some other way
            sideways = np.sin(tilt) * np.array([np.cos(direction), np.sin(direction)])
            gravity = np.array([*sideways, -np.cos(tilt)])
            assert calm.share(gravity, np.array([offset])) == pytest.approx([share])


def test_directions_of_pairs_move_both_sides_together_and_apart_if_they_may(op3: Robot):
    # The left knee is positive where the right one is negative: alike is (+, -), contrary (+, +).
    spec = build_action_spec(op3, ("l_knee",), ("l_knee",))
    left, right = (op3.joint_names.index(name) for name in ("l_knee", "r_knee"))
    assert spec.names == ("l_knee together", "l_knee apart")
    assert spec.directions[0, [left, right]] == pytest.approx([1.0, -1.0])
    assert spec.directions[1, [left, right]] == pytest.approx([0.5, 0.5])
    assert np.count_nonzero(spec.directions) == 4
    assert spec.mirror_sign(op3) == pytest.approx([1.0, -1.0])
    k = len(op3.rising_joints)
    narrow, wide = choose_actions(op3, wide=False), choose_actions(op3, wide=True)
    assert narrow.size == k
    both = k + len(op3.spreading_joints)
    assert wide.mirror_sign(op3).tolist() == [1.0] * both + [-1.0] * both
    assert wide.names[:k] == narrow.names
    assert wide.homing.tolist() == narrow.homing.tolist()


def test_a_policy_step_is_cut_into_equal_parts_that_end_at_the_target():
    """One by one, and several at once."""
    begin, end = np.array([1.0, 0.0]), np.array([2.0, -1.0])
    parts = [between(begin, end, cycle, 4) for cycle in range(4)]
    assert parts[0].tolist() == [1.25, -0.25] and parts[-1].tolist() == [2.0, -1.0]
    assert np.diff(parts, axis=0) == pytest.approx(np.diff(parts, axis=0)[:1].repeat(3, axis=0))
    assert between(begin, end, np.arange(4)[:, None], 4).tolist() == np.array(parts).tolist()


NARROW = build_action_spec(OP3, OP3.rising_joints, ("l_knee",))


def test_a_torque_limit_is_observed_as_a_share_and_no_more_than_the_policy_asks_for():
    limits = np.array([2.05, 4.1, 9.0])
    assert compute_torque_share(OP3, NARROW, limits).tolist() == [[0.5], [1.0], [1.0]]
    assert compute_torque_share(OP3, NARROW, np.inf).tolist() == [1.0]
    gentle = replace(NARROW, pwm_limit=0.55)
    assert compute_torque_share(OP3, gentle, limits).tolist() == [[0.5], [0.55], [0.55]]


def test_every_term_is_where_the_list_says():
    n, k = OP3.n, NARROW.size
    sensed = Sensed(
        gravity=np.full(3, 1.0),
        gyro=np.full(3, 2.0),
        joint_pos=OP3.standing.joint_pos + 3.0,
        joint_vel=np.full(n, 4.0),
    )
    target = sensed.joint_pos + 5.0
    seen = observe(OP3, sensed, target, np.full(k, 6.0), np.full(1, 7.0))
    sizes = [term.size for term in list_terms(OP3, NARROW)]
    parts = np.split(seen, np.cumsum(sizes)[:-1])
    assert [len(part) for part in parts] == sizes
    for value, part in enumerate(parts, start=1):
        assert part == pytest.approx(np.full(len(part), value))
