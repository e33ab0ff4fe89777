"""Room to stand: beside a table and not under it, and nowhere in a low cave."""

import numpy as np

from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.standing_places import ROOM, StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.parts import leg_length

LOW = np.array([0.0, 0.0, 0.05])


def under(op3: Robot, half: float) -> StandingPlaces:
    """Look from under a roof at three quarters of a leg, ``half`` leg lengths to each side."""
    leg = leg_length(op3)
    roof = Obstacle(
        name="roof",
        kind="box",
        half_size=leg * np.array([half, half, 0.02]),
        position=leg * np.array([0.0, 0.0, 0.77]),
    )
    return StandingPlaces(World(op3, Scene(name="roof", obstacles=(roof,))), LOW)


def test_the_nearest_place_is_beside_the_roof_with_some_room(op3: Robot):
    leg, places = leg_length(op3), under(op3, 1.0)
    assert places.exist
    away = float(places.distance(LOW))
    assert (1.0 + ROOM) * leg < away < (1.0 + ROOM + 1.0) * leg
    assert float(places.distance(np.array([3.0 * leg, 0.0, 0.05]))) < 0.2 * leg


def test_under_a_roof_without_end_there_is_no_place(op3: Robot):
    assert not under(op3, 20.0).exist
