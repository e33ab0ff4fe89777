"""Where no stored motion leads to a stand, one is found in physics from the start itself."""

from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.falls import sample_fall
from humanoid_getup.motions.build import lay_down
from humanoid_getup.motions.motion_database import Connection, MotionDatabase, find_motion
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.posture_chains.chain_search import ChainSearch
from humanoid_getup.posture_chains.resting_state import PostureChain, PostureMove
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.approach import MotionFinder
from humanoid_getup.strategies.free_rise import FreeRise
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.rise_search import RiseSearch
from robots import Posture, Robot, TorqueLimit
from robots.body.limbs import Limbs
from robots.body.squats import list_squats
from robots.body.statics import Statics
from robots.kinematics import read_posture

pytestmark = pytest.mark.usefixtures("known_ways_up")

ONE_THREAD = PlannerSettings(threads=1)


@pytest.fixture(scope="module")
def squat(world: World) -> Posture:
    angles = list_squats(Limbs(world.robot), Statics(world.robot))[4].joint_pos
    return read_posture(world.robot, world.model, lay_down(world, "squat", angles))


def test_motions_begin_where_the_robot_is_and_stand_the_shortest_first(world, squat, monkeypatch):
    home = world.robot.standing.joint_pos

    def find_chain(self: ChainSearch) -> None:
        held = self.start.target
        knots = [held + share * (home - held) for share in (0.5, 0.2, 1.0)]
        moves = [PostureMove(knots=k[None], duration=0.8, kind="test") for k in knots]
        chain = PostureChain(start=self.start.qpos, held=held, moves=tuple(moves))
        self.untried.append(chain)

    monkeypatch.setattr(ChainSearch, "advance", find_chain)
    finder = MotionFinder(world, ONE_THREAD)
    found = finder.find(squat, 1e6, np.random.default_rng(0))
    motions = [connection.motion for connection in found]
    assert len(motions) >= 2
    assert [m.duration for m in motions] == sorted(m.duration for m in motions)
    assert all(motion.rises and motion.strategy.startswith("found") for motion in motions)
    assert [connection.frame for connection in found] == [0] * len(found)
    for motion in motions:
        np.testing.assert_allclose(motion.joint_pos[0], squat.joint_pos, atol=1e-6)
    assert finder.simulated > 0.0


def test_what_cannot_rise_is_not_searched(world: World, tiny: Robot, squat: Posture):
    finder = MotionFinder(world, PlannerSettings(torque_limit=TorqueLimit(0.6), threads=1))
    assert finder.find(squat, 1e6, np.random.default_rng(0)) == []
    assert finder.simulated == 0.0
    small = World(tiny)
    finder = MotionFinder(small, ONE_THREAD)
    assert finder.find(tiny.standing, 1e6, np.random.default_rng(0)) == []


@pytest.mark.parametrize(("degrees", "asked"), [(15, 0), (30, 1)])
def test_on_a_steep_slope_a_motion_is_looked_for_before_rollouts(
    op3: Robot, supine: Posture, monkeypatch: pytest.MonkeyPatch, degrees: int, asked: int
):
    rise = PlannedRise(World(op3, load_scene(f"slope:{degrees}", op3)), settings=ONE_THREAD)
    found = list[int]()

    def find(*_: object) -> list[Connection]:
        found.append(rise.filter.count)
        return []

    def stop(*_: object) -> None:
        raise InterruptedError

    monkeypatch.setattr(MotionFinder, "find", find)
    monkeypatch.setattr(FreeRise, "_try_first", stop)
    with pytest.raises(InterruptedError):
        rise.plan(supine, np.random.default_rng(0))
    assert found == [0] * asked


def test_on_a_steep_slope_another_motion_is_looked_for_where_the_first_falls(
    op3: Robot, supine: Posture, monkeypatch: pytest.MonkeyPatch
):
    rise = PlannedRise(World(op3, load_scene("slope:30", op3)), settings=ONE_THREAD)
    asked = list[int]()

    def find(*_: object) -> list[Connection]:
        asked.append(1)
        return rise.database.select(supine, 1)

    def stop(*_: object) -> None:
        raise InterruptedError

    monkeypatch.setattr(MotionFinder, "find", find)
    monkeypatch.setattr(RiseSearch, "try_all", lambda *_: None)
    monkeypatch.setattr(RiseSearch, "vary", lambda _: None)
    monkeypatch.setattr(FreeRise, "_try_first", stop)
    with pytest.raises(InterruptedError):
        rise.plan(supine, np.random.default_rng(0))
    assert len(asked) == 3


def test_a_search_ends_with_its_budget(world, supine, monkeypatch):
    advanced = list[ChainSearch]()

    def spend(self: ChainSearch) -> None:
        advanced.append(self)
        self._player.simulated += 1000.0

    monkeypatch.setattr(ChainSearch, "advance", spend)
    finder = MotionFinder(world, ONE_THREAD)
    assert finder.find(supine, 10_000.0, np.random.default_rng(0)) == []
    assert len(advanced) in (9, 10)  # some time went into the ways up
    assert 10_000.0 <= finder.simulated < 11_000.0


def test_a_plan_whose_stored_motions_fail_goes_on_with_a_found_one(world, op3, monkeypatch):
    known = find_motion(op3, "supine_sit_up_fast")
    lying = read_posture(op3, world.model, lay_down(world, "supine", known.joint_pos[0]))
    asked = list[tuple[Posture, float]]()

    def find(_: object, start: Posture, budget: float, __: object) -> list[Connection]:
        asked.append((start, budget))
        return [Connection(replace(known, name="found", strategy="found, over sit"), 0, 0.0)]

    prone = find_motion(op3, "prone_push_up_fast")
    planner = PlannedRise(
        world, MotionDatabase([prone], PostureMetric.of(op3)), PlannerSettings(search_budget=5.0)
    )
    monkeypatch.setattr(FreeRise, "_try_first", lambda *_: False)
    monkeypatch.setattr(FreeRise, "_try_second", lambda *_: None)
    monkeypatch.setattr(MotionFinder, "find", find)
    plan = planner.plan(lying, np.random.default_rng(0))
    assert asked == [(lying, 100.0)]
    assert plan.status is RiseStatus.STOOD
    assert isinstance(plan, Plan)
    assert plan.title == "rise_by_found"
    assert plan.label == "found, over sit"


@pytest.mark.slow
def test_op3_rises_from_its_back_with_a_motion_from_its_front_alone(world, op3, monkeypatch):
    prone = find_motion(op3, "prone_push_up_fast")
    only = [replace(prone, entry=np.arange(len(prone.time)) == 0)]
    planner = PlannedRise(world, MotionDatabase(only, PostureMetric.of(op3)))
    monkeypatch.setattr(FreeRise, "_try_second", lambda *_: None)
    plan = planner.plan(sample_fall(world, "supine", seed=1).posture, np.random.default_rng(0))
    assert plan.status is RiseStatus.STOOD
    assert plan.title == "rise_by_found"
    assert plan.label.startswith("found, over ")
