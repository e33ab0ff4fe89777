"""Legs and soles of the small humanoid, by hand: lengths, knees, and errors of a stand."""

import numpy as np
import pytest

from robots.body.body_plan import BodyPlan
from robots.body.flat_soles import fit_posture
from robots.body.limb import BEND


def stretch(small: BodyPlan) -> np.ndarray:
    angles = np.zeros(len(small.joint_names))
    small.view.look(angles)
    return angles


def test_a_stretched_leg_is_as_long_as_its_links(small: BodyPlan):
    """By hand: the soles are 30 cm below the hips, 1.5 cm in front of the ankles at -0.27 m."""
    stretch(small)
    foot = np.hypot(0.015, 0.03)
    assert small.left_leg.measure_stretched() == pytest.approx(0.27 + foot, abs=1e-6)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_bent_knee_leads_the_way_and_the_sole_stays_level(small: BodyPlan, way: float):
    angles = stretch(small)
    length = small.left_leg.measure_stretched()
    small.left_leg.bend_knee(angles, way)
    small.view.look(angles)
    assert small.left_leg.measure_stretched() == pytest.approx(length), "it is as long"
    # By hand: thigh and shank of 14 and 13 cm, each turned by half of the bend.
    lead = way * 0.14 * np.sin(BEND / 2.0) * 2.0 * 0.13 / 0.27
    assert small.left_leg.measure_knee_lead() == pytest.approx(lead, rel=0.1)
    assert small.left_leg.sole_axes[:, 2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


def test_fitted_angles_stay_within_their_bounds_and_near_where_they_were():
    """By hand: an angle that should be 2 rad may be 1 rad, one that nothing asks for stays."""
    looked = []

    def look(values: np.ndarray) -> np.ndarray:
        looked.append(values.copy())
        return np.append(values, 9.0)

    def measure() -> np.ndarray:
        return np.array([looked[-1][0] - 2.0])

    bounds = (-np.ones(2), np.ones(2))
    found = fit_posture(look, measure, np.zeros(2), np.array([0.0, 0.4]), bounds)
    assert found == pytest.approx([1.0, 0.4, 9.0], abs=1e-3)
    assert looked[-1] == pytest.approx(found[:2])
