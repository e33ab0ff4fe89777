"""A prone OP3, and the stored motions by name."""

import pytest
from prone_motions import RIGHT

from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import read_posture


@pytest.fixture(scope="module")
def motions(op3: Robot) -> dict[str, Motion]:
    return {motion.name: motion for motion in load_database(op3).motions}


@pytest.fixture(scope="module")
def prone(world: World, motions: dict[str, Motion]) -> Posture:
    at_rest = settle_posture(world, motions[RIGHT].posture(0))
    return read_posture(world.robot, world.model, at_rest)
