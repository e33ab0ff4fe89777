"""Shortcuts skip the postures of a chain that its way up does not need."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.motions.build import lay_down
from humanoid_getup.posture_chains.features import StandMeter
from humanoid_getup.posture_chains.move_player import STANDS, Followed, MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove
from humanoid_getup.posture_chains.shortcuts import ShortcutFinder
from humanoid_getup.simulation.world import World
from robots.body.limbs import Limbs
from robots.body.squats import list_squats
from robots.body.statics import Statics

pytestmark = pytest.mark.usefixtures("few_postures")

WORLDS = 2


@pytest.fixture(scope="module")
def chain(world: World) -> PostureChain:
    """Return a chain from a squat over deeper and higher ones to the stance."""
    squats = [s.joint_pos for s in list_squats(Limbs(world.robot), Statics(world.robot))]
    held, *targets = *(squats[k] for k in (3, 4, 2, 3)), world.robot.standing.joint_pos
    moves = [PostureMove(knots=q[None], duration=1.0, kind="test") for q in targets]
    return PostureChain(start=lay_down(world, "squat", held), held=held, moves=tuple(moves))


@pytest.fixture(scope="module")
def player(world: World) -> MovePlayer:
    return MovePlayer(world, StandMeter(world), np.random.default_rng(0), threads=1)


@pytest.fixture(scope="module")
def scenarios(player: MovePlayer, chain: PostureChain) -> Scenarios:
    return player.sample_worlds(chain.start, WORLDS)


@pytest.fixture
def finder(world: World, player: MovePlayer) -> ShortcutFinder:
    return ShortcutFinder(player, RandomMoves(world.robot, np.random.default_rng(0)), WORLDS)


def test_a_chain_is_traced_to_where_its_moves_end(player: MovePlayer, chain: PostureChain):
    states = player.trace(chain)
    assert np.array_equal(states[0].qpos, chain.start)
    assert [state.target.tolist() for state in states[1:]] == [
        m.target.tolist() for m in chain.moves
    ]
    for state, move, end in zip(states[:-1], chain.moves, states[1:], strict=True):
        assert player.check([state], [move], 1).are_like([end]).all()
    assert states[-1].progress > 0.9


def test_postures_that_nothing_needs_are_skipped(
    finder: ShortcutFinder, player: MovePlayer, chain: PostureChain, scenarios: Scenarios
):
    shorter = finder.shorten(chain, scenarios)
    assert len(shorter.moves) < len(chain.moves)
    assert shorter.duration < chain.duration
    assert np.array_equal(shorter.moves[-1].target, chain.moves[-1].target)
    end = replace(player.trace(shorter)[-1], target=shorter.moves[-1].target)
    assert end.progress > 0.9


def test_a_shortcut_on_which_whole_rises_fall_is_not_taken(
    finder: ShortcutFinder,
    chain: PostureChain,
    scenarios: Scenarios,
    monkeypatch: pytest.MonkeyPatch,
):
    played = list[int]()

    def fall(_: MovePlayer, ends: list, __: Scenarios) -> Followed:
        played.append(len(ends[0].path) - 1)
        lost = 1 if len(played) == 1 else STANDS
        return Followed(lost=np.array([lost]), fallen=np.array([9]), stand=np.array([True]))

    monkeypatch.setattr(MovePlayer, "follow", fall)
    assert finder.shorten(chain, scenarios) is chain
    assert played == sorted(played), "each attempt keeps more of the chain"
    assert len(played) > 1
