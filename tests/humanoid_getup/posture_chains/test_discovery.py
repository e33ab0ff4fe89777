"""A discovery keeps motions of different ways, and knows when a side is done."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.motions import build
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.motions.optimization import LIMIT_SHARES
from humanoid_getup.posture_chains.chain_search import ChainSearch, SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery
from humanoid_getup.posture_chains.motion_maker import MadeMotion, list_shares
from humanoid_getup.posture_chains.resting_state import PostureChain
from humanoid_getup.simulation.world import World
from robots import TorqueLimit

pytestmark = pytest.mark.usefixtures("known_ways_up")

DISCOVERY = "humanoid_getup.posture_chains.discovery"
SMALL = SearchSettings(batch=2, worlds=2, threads=1)
Begin = Callable[..., ChainDiscovery]


@pytest.fixture
def begin(world: World, monkeypatch: pytest.MonkeyPatch) -> Begin:
    """Return a function that begins a discovery whose chains become given motions, in turn."""

    def find_chain(self: ChainSearch) -> None:
        if self.turn == 0:
            self.untried += [
                PostureChain(start=self.start.qpos, held=self.start.target, moves=())
            ] * 9
        self.turn += 1

    def make_discovery(
        *names: str, most: int = 1, side: LyingSide = "supine", **fields: Callable
    ) -> ChainDiscovery:
        motions = iter([find_motion(world.robot, name) for name in names])
        keyframes = load_keyframes(world.robot.folder / "keyframes.toml", world.robot)[0]

        def make(_chain: PostureChain, _rest: float, *, name: str, **_: str) -> MadeMotion:
            motion = replace(next(motions), name=name)
            return MadeMotion(keyframes=keyframes, share=1.0, motion=motion)

        discovery = ChainDiscovery(
            world, seed=0, sides=(side,), most=most, settings=SMALL, **fields
        )
        monkeypatch.setattr(discovery.maker, "make", make)
        return discovery

    monkeypatch.setattr(ChainSearch, "advance", find_chain)
    monkeypatch.setattr(ChainSearch, "shorten", lambda _, chain: chain)
    return make_discovery


def run(discovery: ChainDiscovery, rounds: int) -> list[str]:
    return [made.failure for _ in range(rounds) for _, made in discovery.advance()]


def test_a_kept_motion_is_a_way_up_for_the_other_sides(begin: Begin):
    discovery = begin("supine_sit_up_gentle")
    before = set(discovery.tools.ways_up)
    run(discovery, 1)
    new = [up for up in discovery.tools.ways_up if up not in before]
    assert any(up.cell[:3] == (2, 0, 0) for up in new), "one begins on the back"
    assert {up.onward.kind for up in new if up.onward is not None} == {"motion"}


def test_a_second_motion_takes_another_way(begin: Begin):
    discovery = begin("supine_sit_up_fast", "supine_sit_up_fast", "supine_roll_over", most=2)
    assert run(discovery, 3) == ["", "takes the way of 'supine_found_1'", ""]
    assert [motion.name for motion in discovery.sides[0].kept] == [
        "supine_found_1",
        "supine_found_2",
    ]


def test_what_is_not_accepted_is_not_kept(begin: Begin):
    discovery = begin("supine_sit_up_fast", "supine_sit_up_fast", accept=lambda _: "too hot")
    assert run(discovery, 2) == ["too hot"] * 2
    assert not discovery.sides[0].kept
    assert not discovery.is_done


def test_a_chain_that_waits_for_better_ones_is_tried_where_the_search_ends(begin: Begin):
    discovery = begin("supine_sit_up_fast")
    side = discovery.sides[0]
    side.search.advance()
    side.spent, side.ready = 10.0, 13.0
    assert side.take_chain() is None
    assert [made.failure for _, made in discovery.conclude()] == [""]
    assert [motion.name for motion in side.kept] == ["supine_found_1"]
    assert [*discovery.conclude()] == []  # it has one


def test_a_side_on_which_a_robot_does_not_stay_is_skipped(world, monkeypatch):
    def lay_on_its_back(world: World, side: LyingSide, rng: np.random.Generator) -> object:
        return build.lay_on_side(world, side, rng) if side == "supine" else None

    monkeypatch.setattr(f"{DISCOVERY}.lay_on_side", lay_on_its_back)
    discovery = ChainDiscovery(world, seed=0, settings=SMALL)
    assert [each.side for each in discovery.sides] == ["supine"]
    assert discovery.skipped == ("prone", "left")


def test_it_searches_under_the_lowest_torque_under_which_motions_are_judged(world, monkeypatch):
    full, weakest = float(world.robot.max_torque.max()), min(LIMIT_SHARES)
    for limit, expected in [(None, weakest), (0.8 * full, weakest / 0.8), (0.5 * full, 1.0)]:
        shares = list_shares(world.robot, TorqueLimit(limit))
        assert shares[0] == pytest.approx(expected)
        assert shares == sorted(shares)
    monkeypatch.setattr(f"{DISCOVERY}.find_least_share", lambda *args: args[-1][1])
    discovery = ChainDiscovery(world, seed=0, sides=("supine",), settings=SMALL)
    assert discovery.is_weak
    assert discovery.tools.settings.weakest == discovery.least_share == max(LIMIT_SHARES)
