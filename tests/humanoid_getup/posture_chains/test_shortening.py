"""A chain becomes keyframes that take the same way; these are cut as far as the robot stands."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.motions.build import lay_down
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.optimization import MARGIN, TrajectoryOptimizer
from humanoid_getup.motions.target_search import FoundTargets, TargetSearch
from humanoid_getup.motions.trial import Trial
from humanoid_getup.posture_chains import motion_maker
from humanoid_getup.posture_chains.goal import PostureGoal
from humanoid_getup.posture_chains.motion_maker import MadeMotion, MotionMaker, choose_version
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove
from humanoid_getup.posture_chains.shortening import (
    WORLDS,
    Shortener,
    find_rests,
    make_keyframes,
    thin,
)
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE
from robots.body.limbs import Limbs
from robots.body.squats import list_squats
from robots.body.statics import Statics
from robots.quaternion import Array

REST = 0.3


@pytest.fixture
def unshortened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make motions of chains as they are, which begin at their first frames alone: 5 s each."""
    monkeypatch.setattr(Shortener, "shorten", lambda _, keyframes: [keyframes])
    monkeypatch.setattr(motion_maker, "with_entries", lambda _, motion, __: motion)


@pytest.fixture(scope="module")
def chain(world: World) -> PostureChain:
    """Return a chain from a squat to the stance, with a superfluous posture between."""
    robot = world.robot
    squats = list_squats(Limbs(robot), Statics(robot))
    deep, high, home = squats[4].joint_pos, squats[1].joint_pos, robot.standing.joint_pos
    start = lay_down(world, "squat", deep)
    moves = [
        PostureMove(knots=knots[None], duration=0.8, kind="test") for knots in (high, deep, home)
    ]
    return PostureChain(start=start, held=deep, moves=tuple(moves))


def test_keyframes_of_a_chain_send_its_targets(world: World, chain: PostureChain):
    robot = world.robot
    keyframes = make_keyframes(chain, robot, name="up", start_class="squat", rest=REST)
    sent = keyframes.targets(robot, 0.0)
    expected = chain.sample(robot.control_period, REST)
    rested = round((0.8 + REST) / robot.control_period)  # the first move begins without a rest
    count = min(len(sent) - 1, len(expected))
    assert np.abs(sent[rested + 1 : count + 1] - expected[rested:count]).max() < 0.02
    assert np.array_equal(keyframes.keys[-1], robot.standing.joint_pos)
    assert find_rests(keyframes).tolist() == [False, True] * 3


def test_keys_that_the_curve_passes_anyway_are_left_out(world: World, chain: PostureChain):
    """A motion whose targets were sampled densely has a key for each sample."""
    robot, period = world.robot, world.robot.control_period
    keyframes = make_keyframes(chain, robot, name="up", start_class="squat", rest=REST)
    sampled = keyframes.targets(robot, 0.0)[::5]
    dense = replace(keyframes, keys=sampled, duration=np.full(len(sampled) - 1, 5 * period))
    sizes = list[int]()
    for tolerance in (0.02, 0.1):
        thinned = thin(dense, tolerance)
        sizes.append(len(thinned.keys))
        assert thinned.duration.sum() == pytest.approx(dense.duration.sum())
        assert np.array_equal(thinned.keys[[0, -1]], dense.keys[[0, -1]])
        sent, expected = thinned.targets(robot, 0.0), dense.targets(robot, 0.0)
        assert np.abs(sent - expected).max() < 1.3 * tolerance
    assert len(dense.keys) > 3 * sizes[0] > 3 * sizes[1]
    assert len(thin(keyframes, 0.0).keys) == len(keyframes.keys)


def test_shorter_versions_stand_and_lose_what_is_superfluous(world: World, chain: PostureChain):
    keyframes = make_keyframes(chain, world.robot, name="up", start_class="squat", rest=REST)
    scenarios = MARGIN.sample(world, chain.start, WORLDS, np.random.default_rng(0))
    shortener = Shortener(world, scenarios, threads=1)
    versions = shortener.shorten(keyframes)
    assert versions[0] is keyframes
    assert len(versions[-1].keys) <= 3
    assert versions[-1].duration.sum() < 0.6 * keyframes.duration.sum()
    assert Trial.of(world, versions[-1], chain.start, FULL_TORQUE).succeeded


def test_shorter_versions_keep_the_posture_through_which_they_lead(
    world: World, chain: PostureChain
):
    robot = world.robot
    keyframes = make_keyframes(chain, robot, name="up", start_class="squat", rest=REST)
    high = chain.moves[0].target
    goal = PostureGoal(world, lay_down(world, "squat", high), high, touches=False)
    scenarios = MARGIN.sample(world, chain.start, WORLDS, np.random.default_rng(0))
    shortener = Shortener(world, scenarios, goal=goal, threads=1)
    last = shortener.shorten(keyframes)[-1]
    assert last.duration.sum() < keyframes.duration.sum()
    assert goal.is_passed(Trial.of(world, last, chain.start, FULL_TORQUE).outcome.record)


@pytest.mark.usefixtures("unshortened")
def test_a_motion_of_a_chain_says_how_it_was_made(world: World, chain: PostureChain):
    maker = MotionMaker(world, seed=0, limit=FULL_TORQUE, weakest=0.61, threads=1)
    made = maker.make(chain, REST, name="up", start_class="squat")
    assert made.failure == ""
    assert made.motion.provenance["disturbed_success"] == made.share >= 0.9
    assert made.motion.provenance["program"] == "getup motions discover"
    assert made.motion.strategy == made.keyframes.strategy == "found"
    assert made.motion.rises


@pytest.mark.usefixtures("unshortened")
@pytest.mark.parametrize(("needed", "pace"), [(1.4, 1.5), (9.0, 1.0)])
def test_a_rise_that_stands_too_rarely_is_slowed_down_as_far_as_it_must(
    world: World, chain: PostureChain, monkeypatch: pytest.MonkeyPatch, needed: float, pace: float
):
    made_of = make_keyframes(chain, world.robot, name="up", start_class="squat", rest=REST)
    usual = made_of.duration.sum()

    def judge(_: object, keyframes: Keyframes, *__: object, **___: object):
        share = 1.0 if keyframes.duration.sum() > 0.99 * needed * usual else 0.8
        return 0.0, np.arange(48) < 48 * share

    monkeypatch.setattr(TrajectoryOptimizer, "judge", judge)
    maker = MotionMaker(world, seed=0, limit=FULL_TORQUE, weakest=0.61, threads=1)
    made = maker.make(chain, REST, name="up", start_class="squat", improves=False)
    assert (made.motion is not None) == (needed < 2.0)
    assert made.duration == pytest.approx(pace * usual)


@pytest.mark.usefixtures("unshortened")
def test_a_rise_through_a_posture_that_stands_too_rarely_is_varied(
    world: World, chain: PostureChain, monkeypatch: pytest.MonkeyPatch
):
    found = list[FoundTargets]()

    def search(searching: TargetSearch, scenarios: Scenarios, target: Array, *_: object):
        assert searching.experiment.compare(scenarios.take(np.arange(2)), [target]).stood.all()
        found.append(
            FoundTargets(
                target=target.copy(), share=1.0, generations=1, rollouts=1, simulated=100.0
            )
        )
        return found[-1]

    monkeypatch.setattr(TargetSearch, "search", search)
    judged = lambda *_, **__: (0.0, np.arange(48) < (48 if found else 40))  # noqa: E731
    monkeypatch.setattr(TrajectoryOptimizer, "judge", judged)
    high = chain.moves[0].target
    goal = PostureGoal(world, lay_down(world, "squat", high), high, touches=False)
    maker = MotionMaker(world, seed=0, limit=FULL_TORQUE, weakest=0.61, goal=goal, threads=1)
    made = maker.make(chain, REST, name="up", start_class="squat", improves=False)
    assert made.motion is not None
    assert len(found) == 1
    assert len(made.keyframes.keys) < len(found[0].target) / 5
    assert np.array_equal(made.keyframes.keys[-1], world.robot.standing.joint_pos)
    assert maker.simulated == 100.0  # that of the search, as all else is patched


@pytest.mark.usefixtures("unshortened")
def test_a_chain_that_falls_is_not_kept(world: World, chain: PostureChain):
    bent = chain.moves[0].target.copy()
    bent[[world.robot.joint_names.index(name) for name in ("l_ank_pitch", "l_knee")]] += 0.8
    falls = PostureMove(knots=bent[None], duration=0.4, kind="test")
    lying = lay_down(world, "supine", chain.held)
    broken = PostureChain(start=lying, held=chain.held, moves=(falls, falls))
    maker = MotionMaker(world, seed=0, limit=FULL_TORQUE, weakest=0.61, threads=1)
    made = maker.make(broken, REST, name="down", start_class="squat")
    assert made.motion is None
    assert made.share == 0.0
    assert made.failure == "it falls undisturbed"


def test_the_shortest_version_that_stands_often_enough_is_chosen(world: World, chain: PostureChain):
    keyframes = make_keyframes(chain, world.robot, name="up", start_class="squat", rest=REST)
    versions = [replace(keyframes, name=str(row)) for row in range(30)]
    for shortest_sound in (-1, *range(30)):
        judged = list[MadeMotion]()

        def judge(version: Keyframes, sound: int = shortest_sound, judged=judged) -> MadeMotion:
            row = int(version.name)
            share = 0.95 if row <= sound else 0.8 - row / 100
            judged.append(MadeMotion(keyframes=version, share=share))
            return judged[-1]

        chosen = choose_version(versions, judge)
        assert chosen.keyframes.name == str(max(shortest_sound, 0))
        assert len(judged) <= 6
