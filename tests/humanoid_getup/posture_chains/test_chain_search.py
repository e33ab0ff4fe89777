"""A search moves between resting states, from a fall upwards and from a stand downwards."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import USUAL, Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.build import lay_down
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.posture_chains.chain_search import (
    ChainSearch,
    ChainTools,
    ShortcutFinder,
)
from humanoid_getup.posture_chains.goal import Goal
from humanoid_getup.posture_chains.move_player import STANDS, MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove
from humanoid_getup.simulation.world import World
from robots.body.limbs import Limbs
from robots.body.squats import list_squats
from robots.body.statics import Statics
from robots.quaternion import Array


@pytest.fixture(scope="module")
def lying(world: World) -> Array:
    return lay_down(world, "supine", world.robot.standing.joint_pos)


def test_ways_up_begin_with_squats_from_which_a_robot_stands_up(few_tools: ChainTools):
    squats = [up for up in few_tools.ways_up if up.depth == 1]
    assert len(squats) >= 2
    onward = [up.onward for up in squats if up.onward is not None]
    ends = few_tools.player.check(squats, onward, 17)
    assert ends.stands[:, 0].all()
    assert ends.stands[:, 1:].mean() > 0.95  # in disturbed worlds in which they were not checked
    assert all(up.progress < few_tools.ways_up.goal.progress for up in squats)


def test_entry_frames_of_known_motions_are_ways_up_where_they_lead_to_a_stand(world, few_tools):
    own = few_tools.copy(np.random.default_rng(0))
    rises = find_motion(world.robot, "supine_sit_up_fast")
    halted = replace(rises, joint_target=np.repeat(rises.joint_target[:1], len(rises.time), axis=0))
    for motion, is_way_up in ((halted, False), (rises, True)):
        own.ways_up.add_motions([motion], own.settings.batch)
        added = [up for up in own.ways_up if up.onward and up.onward.kind == "motion"]
        assert bool(added) == is_way_up
    onward = [up.onward for up in added if up.onward is not None]
    assert own.player.check(added, onward, 2).stands.all()
    longest = max(move.duration for move in onward)
    assert longest == pytest.approx(rises.time[-1], rel=0.5), "one is from far below"


def test_where_servos_press_in_vain_softer_targets_are_tried(few_tools: ChainTools, lying: Array):
    """On its back OP3 presses its legs against each other, and its arms against the ground."""
    player, moves = few_tools.player, few_tools.moves
    robot, layout = few_tools.world.robot, few_tools.world.robot.layout(few_tools.world.model)
    states = [player.describe(lying, np.clip(lying[layout.qpos], robot.lower, robot.upper))] * 60
    drawn = moves.draw_all(states, player.scale, np.random.default_rng(3))
    plain = player.try_out(states, drawn)
    assert not np.any(plain.rests & plain.presses)
    tried = list(player.try_softly(states, drawn))
    softer = [each for each in tried if not any(each.move is move for move in drawn)]
    assert len(softer) >= 2
    assert len(tried) - len(softer) == plain.rests.sum()
    for each in softer:
        again = player.try_out([each.begun], [each.move])
        assert again.rests.all()
        assert np.array_equal(each.end.target, each.move.target)


def test_a_move_that_is_kept_ends_at_rest_alike_in_disturbed_worlds(few_tools, lying):
    search = ChainSearch(few_tools, lying)
    for _ in range(2):
        search.advance()
    moved = [state for state in search.archive if state.before is not None]
    assert len(moved) >= 2
    begun = [state.before for state in moved if state.before is not None]
    moves = [state.move for state in moved if state.move is not None]
    ends = few_tools.player.check(begun, moves, 1)
    assert ends.rests.all()
    assert ends.are_like(moved).all()
    assert np.allclose(ends.qpos[:, 0], [state.qpos for state in moved])


def test_a_move_that_topples_a_robot_does_not_end_like_a_stand(few_tools: ChainTools, world: World):
    stance, home = few_tools.ways_up.goal, world.robot.standing.joint_pos
    bent, robot = home.copy(), world.robot
    left, right = (robot.joint_names.index(name) for name in ("l_ank_pitch", "r_ank_pitch"))
    bent[left] += 0.7
    bent[right] = robot.mirror_joints(bent)[right]
    moves = [PostureMove(knots=knots[None], duration=0.5, kind="test") for knots in (home, bent)]
    ends = few_tools.player.check([stance, stance], moves, 2)
    assert ends.stands.tolist() == [[True, True], [False, False]]
    assert ends.are_like([stance, stance]).tolist() == [True, False]
    stands = [replace(stance, before=stance, move=move) for move in moves]
    scenarios = USUAL.sample(world, stance.qpos, 2, np.random.default_rng(0))
    assert few_tools.player.follow(stands, scenarios).lost.tolist() == [STANDS, 1]


def test_one_seed_gives_one_search_with_any_number_of_threads(few_tools: ChainTools, lying: Array):
    found = []
    for threads in (1, 2):
        own = few_tools.copy(np.random.default_rng(5))
        own.settings = replace(own.settings, threads=threads)
        search = ChainSearch(own.copy(own.rng), lying)
        search.advance()
        search.advance()
        found.append(np.array([state.qpos for state in search.archive]))
    assert len(found[0]) > 1
    assert np.array_equal(found[0], found[1])


@pytest.mark.slow
def test_op3_finds_rises_from_its_back_that_disturbances_do_not_break(world: World, lying: Array):
    tools = ChainTools(world, np.random.default_rng(6))
    search = ChainSearch(tools, lying)
    while not search.chains and tools.player.simulated < 10_000.0:
        search.advance()
    sent = search.chains[0].sample(world.robot.control_period, tools.player.rest)
    held = hold_last(sent, len(sent) + 500)
    scenarios = USUAL.sample(world, lying, 16, np.random.default_rng(1))
    outcome = Outcome(Experiment(world).play(scenarios, [held] * 16), world.robot)
    assert outcome.stood.mean() >= 0.5


WORLDS = 2


@pytest.fixture(scope="module")
def chain(world: World) -> PostureChain:
    squats = [s.joint_pos for s in list_squats(Limbs(world.robot), Statics(world.robot))]
    held, *targets = *(squats[k] for k in (3, 4, 2, 3)), world.robot.standing.joint_pos
    moves = [PostureMove(knots=q[None], duration=1.0, kind="test") for q in targets]
    return PostureChain(start=lay_down(world, "squat", held), held=held, moves=tuple(moves))


@pytest.fixture(scope="module")
def player(world: World) -> MovePlayer:
    return MovePlayer(world, Goal(world), np.random.default_rng(0), threads=1)


@pytest.fixture(scope="module")
def scenarios(player: MovePlayer, chain: PostureChain) -> Scenarios:
    return player.sample_worlds(chain.start, WORLDS)


@pytest.fixture
def finder(few_moves: RandomMoves, player: MovePlayer) -> ShortcutFinder:
    return ShortcutFinder(player, few_moves, WORLDS)


def test_a_chain_is_traced_to_where_its_moves_end(player: MovePlayer, chain: PostureChain):
    states = player.trace(chain)
    assert np.array_equal(states[0].qpos, chain.start)
    assert [state.target.tolist() for state in states[1:]] == [
        m.target.tolist() for m in chain.moves
    ]
    for state, move, end in zip(states[:-1], chain.moves, states[1:], strict=True):
        assert player.check([state], [move], 1).are_like([end]).all()
    assert states[-1].progress > 0.9


def test_postures_that_nothing_needs_are_skipped(finder, player, chain, scenarios):
    shorter = finder.shorten(chain, scenarios)
    assert len(shorter.moves) < len(chain.moves)
    assert shorter.duration < chain.duration
    assert np.array_equal(shorter.moves[-1].target, chain.moves[-1].target)
    end = replace(player.trace(shorter)[-1], target=shorter.moves[-1].target)
    assert end.progress > 0.9
