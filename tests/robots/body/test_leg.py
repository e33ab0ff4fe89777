"""A leg: stretched length, and knees that bend either way."""

import numpy as np
import pytest

from robots.body.body_plan import BodyPlan
from robots.body.leg import BEND


def stretch(small: BodyPlan) -> np.ndarray:
    angles = np.zeros(len(small.joint_names))
    small.view.look(angles)
    return angles


def test_a_stretched_leg_is_as_long_as_its_links(small: BodyPlan):
    """By hand: the soles are 30 cm below the hips, 1.5 cm in front of the ankles at -0.27 m."""
    stretch(small)
    foot = np.hypot(0.015, 0.03)
    assert small.left_leg.measure_stretched() == pytest.approx(0.27 + foot, abs=1e-6)


def test_a_bent_leg_is_as_long_as_a_stretched_one(small: BodyPlan):
    angles = stretch(small)
    length = small.left_leg.measure_stretched()
    small.left_leg.bend_knee(angles, 1.0)
    small.view.look(angles)
    assert small.left_leg.measure_stretched() == pytest.approx(length)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_bent_knee_leads_the_way_and_the_sole_stays_level(small: BodyPlan, way: float):
    angles = stretch(small)
    small.left_leg.bend_knee(angles, way)
    small.view.look(angles)
    # By hand: thigh and shank of 14 and 13 cm, each turned by half of the bend.
    lead = way * 0.14 * np.sin(BEND / 2.0) * 2.0 * 0.13 / 0.27
    assert small.left_leg.measure_knee_lead() == pytest.approx(lead, rel=0.1)
    assert small.left_leg.sole_axes[:, 2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
