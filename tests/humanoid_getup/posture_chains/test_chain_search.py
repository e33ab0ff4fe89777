"""A search moves between resting states, from a fall upwards and from a stand downwards."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import USUAL, Scenarios
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.rollouts.play import Experiment
from humanoid_getup.motions.build import lay_down
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.posture_chains.chain_search import (
    ChainSearch,
    ChainTools,
    SearchSettings,
    ShortcutFinder,
)
from humanoid_getup.posture_chains.features import StandMeter
from humanoid_getup.posture_chains.move_player import STANDS, Followed, MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove
from humanoid_getup.simulation.world import World
from robots.body.limbs import Limbs
from robots.body.squats import list_squats
from robots.body.statics import Statics

pytestmark = pytest.mark.usefixtures("few_postures")

SMALL = SearchSettings(batch=12, worlds=2, threads=1)


@pytest.fixture(scope="module")
def lying(world: World) -> np.ndarray:
    return lay_down(world, "supine", world.robot.standing.joint_pos)


@pytest.fixture(scope="module")
def tools(world: World) -> ChainTools:
    return ChainTools(world, np.random.default_rng(0), SMALL)


def test_ways_up_begin_with_squats_from_which_a_robot_stands_up(tools: ChainTools):
    squats = [up for up in tools.ways_up if up.depth == 1]
    assert len(squats) >= 2
    onward = [up.onward for up in squats if up.onward is not None]
    ends = tools.player.check(squats, onward, 17)
    assert ends.stands[:, 0].all()
    assert ends.stands[:, 1:].mean() > 0.95  # in disturbed worlds in which they were not checked
    assert all(up.progress < tools.ways_up.stance.progress for up in squats)


def test_entry_frames_of_known_motions_are_ways_up_where_they_lead_to_a_stand(world: World):
    own = ChainTools(world, np.random.default_rng(0), SMALL)
    rises = find_motion(world.robot, "supine_sit_up_fast")
    halted = replace(rises, joint_target=np.repeat(rises.joint_target[:1], len(rises.time), axis=0))
    for motion, is_way_up in ((halted, False), (rises, True)):
        own.ways_up.add_motions([motion], SMALL.batch)
        added = [up for up in own.ways_up if up.onward and up.onward.kind == "motion"]
        assert bool(added) == is_way_up
    onward = [up.onward for up in added if up.onward is not None]
    assert own.player.check(added, onward, 2).stands.all()
    longest = max(move.duration for move in onward)
    assert longest == pytest.approx(rises.time[-1], rel=0.5), "one is from far below"


def test_where_servos_press_in_vain_softer_targets_are_tried(tools: ChainTools, lying: np.ndarray):
    """On its back OP3 presses its legs against each other, and its arms against the ground."""
    player, moves = tools.player, tools.moves
    robot, layout = tools.world.robot, tools.world.robot.layout(tools.world.model)
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


def test_a_move_that_is_kept_ends_at_rest_alike_in_disturbed_worlds(
    tools: ChainTools, lying: np.ndarray
):
    search = ChainSearch(tools, lying)
    for _ in range(2):
        search.advance()
    moved = [state for state in search.archive if state.before is not None]
    assert len(moved) >= 2
    begun = [state.before for state in moved if state.before is not None]
    moves = [state.move for state in moved if state.move is not None]
    ends = tools.player.check(begun, moves, 1)
    assert ends.rests.all()
    assert ends.are_like(moved).all()
    assert np.allclose(ends.qpos[:, 0], [state.qpos for state in moved])


def test_moves_are_checked_from_where_those_before_have_led(
    tools: ChainTools, world: World, lying: np.ndarray
):
    """A robot that disturbances had rolled onto its front does not end on its back."""
    layout, front = world.robot.layout(world.model), world.robot.standing.joint_pos
    prone = lay_down(world, "prone", front)
    held = np.clip(lying[layout.qpos], world.robot.lower, world.robot.upper)
    state = tools.player.describe(lying, held)
    stay = PostureMove(knots=held[None], duration=0.5, kind="test")
    for arrivals, are_like in (
        (None, True),
        (np.array([lying, lying]), True),
        (np.array([lying, prone]), False),
    ):
        moved = replace(state, arrivals=arrivals)
        ends, (end,) = tools.player.repeat_last([replace(moved, before=moved, move=stay)], 3)
        assert ends.are_like([state]).tolist() == [are_like]
        assert np.array_equal(end.list_arrivals(2), ends.qpos[0, 1:])


def test_a_search_under_less_torque_has_it_in_every_other_disturbed_world(
    world: World, lying: np.ndarray
):
    robot = world.robot
    player = MovePlayer(world, StandMeter(world), np.random.default_rng(0), weakest=0.6, threads=1)
    share = player.sample_worlds(lying, 5).parameters.torque_limit / robot.max_torque.max()
    assert share == pytest.approx([1.0, 0.6, 1.0, 0.6, 1.0])


def test_a_rise_that_needs_full_torque_falls_in_weaker_worlds(tools: ChainTools, world: World):
    """With a twentieth of the torque, servos cannot hold the stance."""
    stance = tools.ways_up.stance
    stay = PostureMove(knots=stance.target[None], duration=0.5, kind="test")
    stand = replace(stance, before=stance, move=stay)
    fallen = []
    for weakest in (1.0, 0.05):
        player = MovePlayer(
            world, StandMeter(world), np.random.default_rng(0), weakest=weakest, threads=1
        )
        found = player.follow([stand], player.sample_worlds(stance.qpos, 4))
        fallen.append(int(found.fallen[0]))
    assert fallen == [0, 2]


def test_a_move_that_topples_a_robot_does_not_end_like_a_stand(tools: ChainTools, world: World):
    stance, home = tools.ways_up.stance, world.robot.standing.joint_pos
    bent, robot = home.copy(), world.robot
    left, right = (robot.joint_names.index(name) for name in ("l_ank_pitch", "r_ank_pitch"))
    bent[left] += 0.7
    bent[right] = robot.mirror_joints(bent)[right]
    moves = [PostureMove(knots=knots[None], duration=0.5, kind="test") for knots in (home, bent)]
    ends = tools.player.check([stance, stance], moves, 2)
    assert ends.stands.tolist() == [[True, True], [False, False]]
    assert ends.are_like([stance, stance]).tolist() == [True, False]
    stands = [replace(stance, before=stance, move=move) for move in moves]
    scenarios = USUAL.sample(world, stance.qpos, 2, np.random.default_rng(0))
    assert tools.player.follow(stands, scenarios).lost.tolist() == [STANDS, 1]


def test_a_chain_that_stops_as_a_servo_trips_is_lost_with_that_move(
    tools: ChainTools, lying: np.ndarray, monkeypatch: pytest.MonkeyPatch
):
    """A robot lies still through three moves; what follows where it stops is never seen."""
    player, robot = tools.player, tools.world.robot
    held = np.clip(lying[robot.layout(tools.world.model).qpos], robot.lower, robot.upper)
    start = player.describe(lying, held)
    stay = PostureMove(knots=start.target[None], duration=0.5, kind="test")
    end = start
    for _ in range(3):
        end = replace(start, before=end, move=stay)
    scenarios = player.sample_worlds(lying, 2)
    assert player.follow([end], scenarios).lost.tolist() == [3], "it ends in no stand"
    each = len(stay.sample(start.target, robot.control_period, player.rest))
    play = Experiment.play

    def trip(
        self: Experiment, scenarios: Scenarios, sent: np.ndarray, *, stop_early: bool
    ) -> Record:
        record = play(self, scenarios, sent, stop_early=stop_early)
        stopped = np.full_like(record.cycles, each + 5)
        return replace(record, cycles=stopped, failed=np.ones_like(record.failed))

    monkeypatch.setattr(Experiment, "play", trip)
    assert player.follow([end], scenarios).lost.tolist() == [2], "it trips in the second move"


def test_a_posture_in_which_a_servo_has_all_its_torque_is_no_rest(
    tools: ChainTools, world: World, lying: np.ndarray
):
    """A leg is pressed against the other one, which stays where it is, or touches nothing."""
    robot, layout = world.robot, world.robot.layout(world.model)
    held = np.clip(lying[layout.qpos], robot.lower, robot.upper)
    begun, hip = tools.player.describe(lying, held), robot.joint_names.index("l_hip_roll")
    moves = []
    for angle in (held[hip], robot.lower[hip], robot.upper[hip]):
        knots = held.copy()
        knots[hip] = angle
        moves.append(PostureMove(knots=knots[None], duration=0.5, kind="test"))
    ends = tools.player.check([begun] * len(moves), moves, 1)
    assert ends.rests.tolist() == [[True], [True], [False]]


def test_a_move_that_leads_to_a_goal_and_presses_there_has_softer_targets(
    tools: ChainTools, world: World, lying: np.ndarray
):
    """A leg is pressed against the other one, or goes back to where it was."""
    robot, layout, player = world.robot, world.robot.layout(world.model), tools.player
    held = np.clip(lying[layout.qpos], robot.lower, robot.upper)
    begun, hip = player.describe(lying, held), robot.joint_names.index("l_hip_roll")
    pressed = held.copy()
    pressed[hip] = robot.upper[hip]
    moves = [PostureMove(knots=to[None], duration=0.5, kind="test") for to in (held, pressed)]
    ends = player.check([begun, begun], moves, 1)
    assert ends.presses.tolist() == [[False], [True]]
    goals = [ends.state(k, move.target) for k, move in enumerate(moves)]
    stays, softer = player.lead([begun, begun], moves, goals, 2)
    assert stays is moves[0]
    assert softer is not None and held[hip] < softer.target[hip] < pressed[hip]
    assert player.check([begun], [softer], 1).rests.all()
    assert player.lead([begun], [moves[1]], [tools.ways_up.stance], 2) == [None]


def test_one_seed_gives_one_search_with_any_number_of_threads(world: World, lying: np.ndarray):
    found = []
    for threads in (1, 2):
        settings = SearchSettings(batch=8, worlds=2, threads=threads)
        search = ChainSearch(ChainTools(world, np.random.default_rng(5), settings), lying)
        search.advance()
        search.advance()
        found.append(np.array([state.qpos for state in search.archive]))
    assert len(found[0]) > 1
    assert np.array_equal(found[0], found[1])


def test_a_search_leaves_nothing_to_the_next_one(tools: ChainTools, lying: np.ndarray):
    known, found = len(tools.ways_up), list[np.ndarray]()
    for _ in range(2):
        own = tools.copy(np.random.default_rng(5))
        search = ChainSearch(own, lying)
        search.advance()
        search.advance()
        found.append(np.array([state.qpos for state in (*own.ways_up, *search.archive)]))
    assert len(found[0]) > known + 1
    assert np.array_equal(found[0], found[1])
    assert len(tools.ways_up) == known


@pytest.mark.slow
def test_op3_finds_rises_from_its_back_that_disturbances_do_not_break(
    world: World, lying: np.ndarray
):
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
