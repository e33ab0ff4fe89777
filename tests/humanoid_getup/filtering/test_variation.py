import numpy as np
import pytest

from humanoid_getup.filtering.variation import Variation, pair_directions


@pytest.fixture
def target(op3):
    """Targets that sway within the joints' limits, slower than the servos."""
    middle, half = (op3.upper + op3.lower) / 2.0, (op3.upper - op3.lower) / 4.0
    phase = np.linspace(0.0, 2.0 * np.pi, 400)[:, None]
    return middle + 0.3 * half * np.sin(phase)


def test_no_variation_changes_nothing(op3, target):
    same = Variation.of(np.zeros(Variation.size(op3))).apply(target, target[0], op3)
    np.testing.assert_allclose(same, target, atol=1e-12)


def test_a_pair_of_joints_moves_as_its_own_mirror_image(op3):
    directions = pair_directions(op3)
    assert len(directions) == 7  # arms: two and an elbow; legs: two hips, a knee and an ankle
    np.testing.assert_array_equal(op3.mirror_joints(directions), directions)


def test_stretches_last_as_much_longer_as_their_tempo_says(op3, target):
    slow = Variation.of(np.zeros(Variation.size(op3)))
    slow.tempo[0] = np.log(2.0)  # the first of six stretches: a sixth of the motion longer
    longer = slow.apply(target, target[0], op3)
    assert len(longer) == pytest.approx(len(target) * 7.0 / 6.0, abs=2)
    np.testing.assert_allclose(longer[-1], target[-1], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_variations_keep_limits_and_speed_and_end_in_the_same_posture(op3, target, seed):
    varied = Variation.of(np.random.default_rng(seed).normal(size=Variation.size(op3)))
    sent = varied.apply(target, target[0], op3)
    steps = np.diff(sent, axis=0, prepend=target[:1])
    assert np.all(np.abs(steps) <= op3.max_velocity * op3.control_period)
    assert np.all((sent >= op3.lower) & (sent <= op3.upper))
    np.testing.assert_allclose(sent[-1], target[-1], atol=0.05)


def test_limited_targets_catch_up_at_the_servos_speed(op3):
    far = np.tile(op3.standing.joint_pos, (200, 1))
    start = np.clip(op3.standing.joint_pos + 0.5, op3.lower, op3.upper)
    sent = op3.limit_targets(far, start)
    assert np.abs(sent[0] - start).max() < 0.06  # at most 6.8 rad/s for 8 ms
    np.testing.assert_allclose(sent[-1], far[-1])
