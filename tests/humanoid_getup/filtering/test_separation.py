"""Shifts part limbs that touch, and rises that touch themselves no longer do."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.outcome import DEEP_OVERLAP
from humanoid_getup.filtering.candidate import Candidate, straight_path
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.separation import FADES, MARGINS, Separation
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.posture_metric import align
from robots.kinematics import place

FRAMES, TOUCH = 200, slice(90, 110)


def _overlap(model, qpos):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    own = [c.dist for c in data.contact if 0 not in model.body_rootid[model.geom_bodyid[c.geom]]]
    return max((-distance for distance in own), default=0.0)


@pytest.fixture(scope="module")
def touching(world, op3):
    """Legs that swing together and apart again: positions (T, nq), and their overlap (T,)."""
    qpos = np.tile(place(op3, world.model, op3.standing), (FRAMES, 1))
    inward = np.zeros(op3.n)
    inward[[op3.joint_names.index(f"{side}_hip_roll") for side in "lr"]] = 1.0, -1.0
    angles = op3.layout(world.model).qpos
    for sign in (1.0, -1.0):
        for angle in np.linspace(0.0, 0.4, 200):
            posed = qpos[0].copy()
            posed[angles] += sign * angle * inward
            if _overlap(world.model, posed) > 0.001:
                qpos[TOUCH] = posed
                return qpos, np.array([_overlap(world.model, row) for row in qpos])
    raise AssertionError("the legs do not touch")


def test_a_shift_makes_the_distance_that_it_should_and_fades_out(world, op3, touching):
    qpos, overlap = touching
    separation = Separation(world)
    shifts = [s for margin in MARGINS for s in separation.shift(qpos, overlap, FRAMES, margin)]
    assert len(shifts) == 2 * len(MARGINS) * len(FADES)
    angles = op3.layout(world.model).qpos
    for shift in shifts:
        separated = qpos[100].copy()
        separated[angles] += shift[100]
        assert overlap[100] > 0.001
        assert _overlap(world.model, separated) < 1e-6
        assert not shift[0].any()
        assert not shift[-1].any()
        assert np.abs(np.diff(shift, axis=0)).max() < op3.max_velocity.min() * op3.control_period


@pytest.mark.parametrize("count", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_rises_that_touch_themselves_are_separated_and_still_stand(world, op3, count):
    dynamics_filter, database = DynamicsFilter(world), load_database(op3)
    before, after = 0, 0
    falls = sample_falls(world, {"supine": 2, "prone": 2}, np.random.default_rng(6))
    for fall in falls[:count]:
        start = fall.posture
        candidates = [
            Candidate(
                path=straight_path(start, align(c.posture, start), 3.0, op3.control_period),
                connection=c,
            )
            for c in database.select(start, 3)
        ]
        for one in dynamics_filter.roll_out(start, candidates):
            if one.stood and one.collides:
                separated = dynamics_filter.separate(start, one, 1000.0)
                before, after = before + 1, after + separated.collides
                assert separated.stood
                assert separated.overlap.max() <= max(one.overlap.max(), DEEP_OVERLAP)
                assert dynamics_filter.separate(start, one, 0.0) is one
    assert before >= 3
    assert after <= before // 3
