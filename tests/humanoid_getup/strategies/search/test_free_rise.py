"""The rounds of a free rise: what is tried, and what ends them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.scenes.scene import FLAT_SCENE, lying
from humanoid_getup.simulation.placement import StandingPlaces
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.free_rise import (
    ENTRIES_OF_EACH,
    FIRST_CONNECTIONS,
    MORE_CONNECTIONS,
    MOST_ENDS,
    SETTLE_TIME,
    WIDER_CONNECTIONS,
    Continuation,
    FreeRise,
)
from humanoid_getup.strategies.rise_search import SearchTools
from robots import Posture, Robot
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
def start(database):
    return next(m for m in database.rising if m.start_class == "prone").posture(0)


@pytest.fixture
def search(world, database, start):
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
    assert len(entries) == len(set(entries)) == WIDER_CONNECTIONS
    for tried in (dynamics.rounds[1], dynamics.rounds[2]):
        assert any(c.assistance == 0.0 for c in tried)
    names = [name for name, _ in entries]
    assert max(map(names.count, names)) == ENTRIES_OF_EACH


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


LENGTH, MOVING = 400, 50


def failed(robot: Robot, world: World, side: str, y: float) -> Any:
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
    length = MOVING + round(SETTLE_TIME / op3.control_period)
    assert all(len(end.target) == length for end in ends)


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
