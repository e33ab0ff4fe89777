"""Randomization: drawn from its ranges, by the seed, around the robot as described."""

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import MOST_DELAY
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots.servo import CURRENT, PWM
from sim2real.environment.env_options import ALL as R

N = 400


@pytest.fixture(scope="module")
def drawn(world) -> DomainParameters:
    return R.draw(world, N, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("name", "lower", "upper"),
    [
        ("com_shift", -0.01, 0.01),
        ("friction", 0.3, 1.2),
        ("voltage", 10.5, 12.6),  # shares of the nominal 12 V
        ("friction_loss", 0.3, 1.6),
        ("joint_offset", -0.026, 0.026),
        ("backlash", 0.0, 0.018),
    ],
)
def test_draws_fill_their_range_and_stay_inside(drawn, name, lower, upper):
    values = getattr(drawn, name)
    assert np.all((values >= lower) & (values <= upper))
    margin = 0.1 * (upper - lower)
    assert values.min() < lower + margin
    assert values.max() > upper - margin


def test_delays_share_what_they_may_last_together(drawn):
    both = drawn.action_delay + drawn.sensor_delay
    for delay in (drawn.action_delay, drawn.sensor_delay):
        assert np.all((delay >= 0.0) & (delay <= MOST_DELAY))
        assert delay.max() > 0.8 * MOST_DELAY
    assert both.max() <= 0.06
    assert both.max() > 0.8 * 0.06


def test_a_share_of_robots_has_all_its_torque_and_a_share_one_weak_servo(op3, drawn):
    own = op3.max_torque.max()
    assert np.mean(drawn.torque_limit == own) == pytest.approx(0.35, abs=0.08)
    assert np.mean(drawn.limit_by == PWM) == pytest.approx(0.5, abs=0.08)
    assert set(drawn.limit_by.tolist()) == {CURRENT, PWM}, "OP3's own, else"
    weak = drawn.strength < 0.92
    assert np.all(weak.sum(axis=1) <= 1)
    assert drawn.strength.min() >= 0.92 * 0.55
