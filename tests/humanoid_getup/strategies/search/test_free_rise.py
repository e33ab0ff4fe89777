"""The rounds of a free rise: what is tried, and what ends them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.search.free_rise import (
    FIRST_CONNECTIONS,
    MORE_CONNECTIONS,
    MOST_CONNECTIONS,
    MOST_ENTRIES,
    FreeRise,
)
from humanoid_getup.strategies.search.rise_search import SearchTools
from robots.kinematics import place


@dataclass
class Filter:
    """A dynamics filter in which a candidate stands that meets a condition."""

    stands: Callable[[Candidate], bool]
    lying: np.ndarray
    share: float = 1.0
    enough: float = 1.0
    hopeless: float = 9.0
    rounds: list[list[Candidate]] = field(default_factory=list)
    searches: int = 0

    assistance: float = 1.0
    is_demanding: bool = False

    @property
    def preference(self):
        return SimpleNamespace(is_demanding=self.is_demanding, improvement=0.5)

    def roll_out(self, _start, candidates):
        self.rounds.append(candidates)
        return [
            SimpleNamespace(
                candidate=c,
                stood=self.stands(c),
                cost=1.0,
                collides=False,
                peak_neck=0.3,
                target=np.zeros((100, 20)),
                qpos=np.tile(self.lying, (100, 1)),
                moving=50,
            )
            for c in candidates
        ]

    def separate(self, _start, rollout, _budget):
        return rollout

    def confirm(self, _start, rollout):
        return rollout

    def check(self, *_, **__):
        return self.share

    def search(self, _start, base, _budget, _rng):
        self.searches += 1
        return base, 0.0


@dataclass
class Approach:
    """Paths that are always found, and are nothing."""

    planning: bool = True

    def candidates(self, _start, connections, _rng, before=None):
        return [Candidate(path=None, connection=c, before=before) for c in connections]

    def move_straight(self, start, connections, before=None):
        return self.candidates(start, connections, None, before)


@pytest.fixture(scope="module")
def world(op3):
    return World(op3, FLAT_SCENE)


@pytest.fixture(scope="module")
def database(op3):
    return load_database(op3)


@pytest.fixture(scope="module")
def start(database):
    return next(m for m in database.rising if m.start_class == "prone").posture(0)


@pytest.fixture
def search(world, database, start):
    """Search from a prone posture, with a filter of given answers."""

    def search(stands, share=1.0, finder=None, **fields):
        lying = place(world.robot, world.model, start)
        dynamics = Filter(stands, lying, share, **fields)
        tools = SearchTools(
            world=world,
            database=database,
            approach=Approach(),
            filter=dynamics,
            finder=finder,
            budget=100.0,
        )
        return dynamics, FreeRise(tools).search(start, np.random.default_rng(0))

    return search


def test_where_the_virtual_actuator_is_in_the_way_the_motion_is_played_as_it_is(search):
    dynamics, found = search(lambda c: c.assistance == 0.0 and c.slowdown is None)
    assert found.rollout.candidate.assistance == 0.0
    assert len(dynamics.rounds) == 2
    assert dynamics.searches == 0
    plain = [c for c in dynamics.rounds[1] if c.assistance == 0.0]
    assert len(plain) == FIRST_CONNECTIONS + MORE_CONNECTIONS


def test_where_nothing_stands_more_entries_of_each_motion_are_tried_and_then_one_is_found(search):
    asked = list[float]()
    finder = SimpleNamespace(find=lambda _start, budget, _rng: asked.append(budget) or [])
    dynamics, found = search(lambda _: False, finder=finder)
    assert found.rollout is None
    assert len(asked) == 1
    entries = [
        (c.connection.motion.name, c.connection.frame) for c in dynamics.rounds[2] if c.assistance
    ]
    assert len(entries) == len(set(entries)) == MOST_CONNECTIONS
    for tried in (dynamics.rounds[1], dynamics.rounds[2]):
        assert any(c.assistance == 0.0 for c in tried)
    names = [name for name, _ in entries]
    assert max(map(names.count, names)) == MOST_ENTRIES


@pytest.mark.parametrize(("share", "has_second_tries"), [(15 / 16, False), (13 / 16, True)])
def test_a_rise_that_stands_in_nearly_all_worlds_gets_no_second_tries(
    search, share, has_second_tries
):
    dynamics, found = search(lambda _: True, share)
    assert found.robust == share
    assert dynamics.searches == 1
    assert (len(dynamics.rounds) > 2) is has_second_tries


def test_a_rise_that_must_be_more_than_successful_gets_second_tries_all_the_same(search):
    dynamics, _ = search(lambda _: True, 15 / 16, is_demanding=True)
    assert len(dynamics.rounds) > 2
