"""The human of the papers stands."""

import numpy as np

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.standing import HOLD_TIME, judge
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.kinematics import place


def test_its_stance_is_held():
    human = load_robot("human")
    human_world = World(human)
    start = place(human, human_world.model, human.standing)
    count = round((HOLD_TIME + 0.5) / human.control_period)
    targets = np.tile(human.standing.joint_pos, (1, count, 1))
    nominal = DomainParameters.nominal(human_world, 1)
    trace = play(human_world, Scenarios(starts=start[None], parameters=nominal), targets)
    upright = trace.upright[0]
    assert judge(upright, human.control_period).stood
    assert trace.overlap.max() <= 0.0
