"""The human of the papers: its symmetry, and that it stands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.standing import HOLD_TIME, judge
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import load_robot, quaternion
from robots.kinematics import center_of_mass, place


@pytest.fixture(scope="module")
def human():
    return load_robot("human")


@pytest.fixture(scope="module")
def model(human):
    return human.spec().compile()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_a_mirrored_posture_has_its_mass_center_mirrored(human, model, seed):
    joint_pos = np.random.default_rng(seed).uniform(human.lower, human.upper)
    both = np.array([joint_pos, human.mirror_joints(joint_pos)])
    upright = np.tile(quaternion.IDENTITY, (2, 1))
    one, other = center_of_mass(human, model, np.zeros((2, 3)), upright, both)
    assert other == pytest.approx(one * [1.0, -1.0, 1.0], abs=1e-9)


def test_its_stance_is_held(human):
    human_world = World(human)
    start = place(human, human_world.model, human.standing)
    count = round((HOLD_TIME + 0.5) / human.control_period)
    targets = np.tile(human.standing.joint_pos, (1, count, 1))
    nominal = DomainParameters.nominal(human_world, 1)
    trace = play(human_world, Scenarios(starts=start[None], parameters=nominal), targets)
    upright = trace.upright[0]
    assert judge(upright, human.control_period).stood
    assert trace.overlap.max() <= 0.0
