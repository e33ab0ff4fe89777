"""The search keeps the rise that loses the fewest keys, is the most robust, and costs least."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from humanoid_getup.filtering.candidate import Candidate
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import (
    MOST_FAILURES,
    MOST_FAILURES_IN_ALL,
    Approach,
)
from humanoid_getup.strategies.rise_search import RiseSearch, SearchTools


@dataclass(frozen=True, eq=False)
class Rolled:
    """A rollout, by what the search looks at."""

    name: str
    cost: float = 1.0
    share: float = 1.0
    """Of the disturbed rollouts in which it stands."""
    lost: int = 0
    stood: bool = True
    collides: bool = False
    peak_neck: float = 0.3

    @property
    def target(self) -> str:
        return self.name

    @property
    def candidate(self) -> SimpleNamespace:
        return SimpleNamespace(connection=SimpleNamespace(motion=self))


@dataclass
class Filter:
    """A dynamics filter whose rollouts, checks and variations are given."""

    rolled: list[Rolled]
    varied: Rolled | None = None
    is_demanding: bool = False
    enough: float = 1.0
    hopeless: float = 0.0
    checked: list[str] = field(default_factory=list)
    bases: list[str] = field(default_factory=list)

    @property
    def preference(self) -> SimpleNamespace:
        return SimpleNamespace(is_demanding=self.is_demanding, improvement=0.5)

    def roll_out(self, _start, _candidates) -> list[Rolled]:
        return self.rolled

    def separate(self, _start, rollout: Rolled, budget: float) -> Rolled:
        assert budget == 50.0
        return rollout

    def confirm(self, _start, rollout: Rolled) -> Rolled:
        return rollout

    def check(self, _start, target: str, _rng, *, least: float) -> float:
        assert least == 0.0 or self.checked
        self.checked.append(target)
        known = [*self.rolled, *([self.varied] if self.varied else [])]
        return next(one.share for one in known if one.name == target)

    def search(self, _start, base: Rolled, budget: float, _rng) -> tuple[Rolled, float]:
        self.bases.append(base.name)
        assert budget == 100.0
        return (self.varied, self.varied.share) if self.varied else (base, 0.0)

    def improve(self, _start, base: Rolled, budget: float, _rng) -> Rolled:
        assert budget == 50.0
        return self.varied or base


def search_with(dynamics: Filter) -> RiseSearch:
    tools = SearchTools(
        world=None, database=None, approach=None, filter=dynamics, finder=None, budget=100.0
    )
    search = RiseSearch(tools, None, np.random.default_rng(0), lambda one: one.lost)
    search.try_all([Candidate(path=None, connection=None)])
    return search


@pytest.mark.parametrize(
    ("rolled", "best", "checked"),
    [
        ([Rolled("dear", 2.0), Rolled("cheap", 1.0)], "cheap", ["cheap"]),
        ([Rolled("cheap", 1.0, 0.5), Rolled("robust", 2.0)], "robust", ["cheap", "robust"]),
        ([Rolled("lossy", 1.0, lost=1), Rolled("keeping", 2.0, 0.5)], "keeping", None),
        ([Rolled("fallen", stood=False), Rolled("frail", share=0.0)], None, ["frail"]),
        ([Rolled("touching", 1.0, collides=True), Rolled("free", 0.5, 0.9)], "touching", None),
    ],
)
def test_the_best_is_kept_and_no_more_is_checked_than_needed(rolled, best, checked):
    dynamics = Filter(rolled)
    found = search_with(dynamics).found
    assert (found.rollout and found.rollout.name) == best
    assert checked is None or dynamics.checked == checked
    assert (found.rounds, found.rolled_out, found.highest) == (1, True, 0.3)


def test_where_physics_is_expensive_less_is_enough():
    """15 of 16 rollouts, as docs/explanation/filtering.md says of what counts as solved."""
    dynamics = Filter([Rolled("first", 1.0, 15 / 16), Rolled("second", 2.0)], enough=0.9)
    search = search_with(dynamics)
    assert search.is_done
    assert dynamics.checked == ["first"]


def test_what_stands_nowhere_is_varied_from_those_that_rose_highest():
    low, high, higher = (Rolled(f"{z}", stood=False, peak_neck=z) for z in (0.1, 0.2, 0.3))
    dynamics = Filter([low, high, higher])
    search = search_with(dynamics)
    search.vary()
    assert dynamics.bases == ["0.3", "0.2"]
    assert search.found.rollout is None


@pytest.mark.parametrize(("lost", "taken"), [(0, True), (1, False)])
def test_no_variation_may_lose_a_key_that_the_best_has(lost: int, taken: bool):
    frail, varied = Rolled("frail", share=0.5), Rolled("varied", lost=lost)
    search = search_with(Filter([frail], varied))
    search.vary()
    assert search.found.rollout is (varied if taken else frail)
    assert search.is_done is taken


@pytest.mark.parametrize(("lost", "taken"), [(0, True), (1, False)])
def test_an_improvement_is_remembered_with_what_it_replaced(lost: int, taken: bool):
    plain, better = Rolled("plain"), Rolled("better", cost=0.5, lost=lost)
    search = search_with(Filter([plain], better, is_demanding=True))
    search.improve()
    found = search.found
    assert (found.rollout, found.before) == ((better, plain) if taken else (plain, None))


@pytest.mark.parametrize(
    ("rolled", "text"),
    [
        ([Rolled("roll", share=0.75)], "the best, along roll, stands in 75% of its disturbed"),
        (
            [Rolled("low", stood=False, peak_neck=0.1), Rolled("high", stood=False)],
            "none stands yet; the best, along high, raised the neck to 60%",
        ),
    ],
)
def test_a_search_says_at_any_time_what_it_has_found(rolled: list[Rolled], text: str):
    assert search_with(Filter(rolled)).found.describe(0.5).startswith(text)


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
