"""Approaches: which motions a start is connected to, and when the search for paths is given up."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import (
    MOST_FAILURES,
    MOST_FAILURES_IN_ALL,
    SLOW,
    Approach,
)


@pytest.fixture(scope="module")
def connections(world: World):
    database = load_database(world.robot)
    return database.select(database.rising[0].posture(0), 8)


class Blocked(Approach):
    """Finds paths as a list of answers says."""

    def __init__(self, world: World, found: list[bool]) -> None:
        super().__init__(world, planning=False)
        self.left = list(found)

    def path(self, start, connection, rng):
        return super().path(start, connection, rng) if self.left.pop(0) else None


@pytest.mark.parametrize(
    ("found", "tried", "kept"),
    [
        ([False] * 8, MOST_FAILURES, 0),
        ([True, *[False] * 7], MOST_FAILURES_IN_ALL + 1, 1),
        ([False, True, False, True, True, True, False, True], 8, 5),
    ],
)
def test_a_start_is_given_up_early_only_while_nothing_was_found(
    world, connections, found, tried, kept
):
    approach = Blocked(world, found)
    start = connections[0].posture
    candidates = approach.candidates(start, connections, np.random.default_rng(0))
    assert (len(found) - len(approach.left), len(candidates)) == (tried, kept)


def test_without_planning_a_path_is_straight_to_where_the_motion_is_joined(world, connections):
    approach = Approach(world, planning=False)
    joined = connections[3]
    start = replace(joined.posture, joint_pos=joined.posture.joint_pos + 0.3)
    targets = np.tile(start.joint_pos, (4, 1))
    rng = np.random.default_rng(0)
    (candidate,) = approach.candidates(start, [joined], rng, targets)
    (slow,) = approach.move_straight(start, [joined])
    assert (candidate.tempo, slow.tempo, slow.before) == (1.0, SLOW, None)
    assert candidate.before is targets
    np.testing.assert_allclose(candidate.path.joint_pos[-1], joined.posture.joint_pos)
    np.testing.assert_array_equal(slow.path.joint_pos, candidate.path.joint_pos)
