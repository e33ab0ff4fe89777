"""Approaches: which motions a start is connected to, and when the search for paths is given up."""

import numpy as np
import pytest

from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import (
    MOST_FAILURES,
    MOST_FAILURES_IN_ALL,
    Approach,
)


@pytest.fixture(scope="module")
def connections(world: World):
    database = load_database(world.robot)
    return database.select(database.rising[0].posture(0), 8)


class Blocked(Approach):
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
