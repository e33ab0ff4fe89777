"""What is tried again: ends of different attitudes, and among obstacles the freest first."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from humanoid_getup.scenes.start_region import lying
from humanoid_getup.simulation.standing_places import StandingPlaces
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.search.continuation import MOST_ENDS, REST, Continuation
from robots import Posture, Robot
from robots.kinematics import place

LENGTH, MOVING = 400, 50


def failed(robot: Robot, world: World, side: str, y: float) -> Any:
    """Make a rollout that fails and ends lying on a side at a place."""
    posture = Posture(
        position=np.array([0.0, y, 0.08]),
        orientation=lying(side),
        joint_pos=robot.standing.joint_pos,
    )
    qpos = np.tile(place(robot, world.model, posture), (LENGTH, 1))
    target = np.arange(LENGTH)[:, None] * np.ones(robot.n)
    return SimpleNamespace(stood=False, moving=MOVING, target=target, qpos=qpos)


def test_alike_ends_are_picked_once_and_cut_at_rest(op3: Robot):
    world = World(op3)
    tried = [failed(op3, world, side, 0.0) for side in ("prone", "prone", "supine", "left")]
    stood = failed(op3, world, "right", 0.0)
    stood.stood = True
    ends = Continuation(world, None).pick(cast("list[Any]", [*tried, stood]))
    assert len(ends) == MOST_ENDS
    length = MOVING + round(REST / op3.control_period)
    assert all(len(end.target) == length for end in ends)


def test_without_obstacles_what_was_not_picked_is_forgotten(op3: Robot):
    world = World(op3)
    continuation = Continuation(world, None)
    continuation.pick([failed(op3, world, side, 0.0) for side in ("prone", "prone")])
    assert continuation.pick([]) == []


def test_under_a_table_the_freest_ends_come_first_and_the_others_wait(op3: Robot):
    world = World(op3, "table")
    places = StandingPlaces(world, np.array([0.0, 0.0, 0.05]))
    continuation = Continuation(world, places)
    tried = [failed(op3, world, "prone", y) for y in (0.0, 0.3, 0.1)]
    first = continuation.pick(tried)
    assert [round(float(end.posture.position[1]), 3) for end in first] == [0.3]
    second = continuation.pick([failed(op3, world, "supine", 0.0)])
    assert [round(float(end.posture.position[1]), 3) for end in second] == [0.1, 0.0]
    assert second[0].confinement < second[1].confinement
