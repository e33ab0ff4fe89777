"""The nearest solved rise begins the next one: only where it fits, and only where it stands."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import Twin
from humanoid_getup.execution.attempt_manager import MOST_PLANS
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.execution.result import AttemptStatus
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.starts.falls import sample_fall
from humanoid_getup.motions.motion import FOUND, Motion
from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.motions.posture_metric import aligned_orientation_distance
from humanoid_getup.scenes.obstacle import make_capsule
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.scenes.surface import Surface
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.cached_rise import (
    MOST_DISTANCE,
    NEAR_CHECKS,
    CachedRise,
    KeptPlan,
    compute_fingerprint,
    fit,
)
from humanoid_getup.strategies.cache.plan_cache import PlanCache
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from robots import Body, Posture, TorqueLimit, quaternion, reshape

SEED = 0


class CountingPlanner(PlannedRise):
    """Answers with one plan, and remembers what it was asked with."""

    def __init__(self, *arguments, answer: RisePlan, **options) -> None:
        super().__init__(*arguments, **options)
        self.answer = answer
        self.states: list[dict] = []

    def plan(self, _start: Posture, rng: np.random.Generator) -> RisePlan:
        self.states.append(dict(rng.bit_generator.state))
        return self.answer


@pytest.fixture(scope="module")
def database(op3) -> MotionDatabase:
    return load_database(op3)


@pytest.fixture(scope="module")
def start(world) -> Posture:
    return sample_fall(world, "prone", seed=4).posture


@pytest.fixture(scope="module")
def planner(world, database) -> PlannedRise:
    return PlannedRise(world, database)


@pytest.fixture(scope="module")
def solved(planner, start, tmp_path_factory) -> tuple[KeptPlan, Path]:
    """A fresh plan, and the folder of the cache that keeps it."""
    folder = tmp_path_factory.mktemp("solved")
    plan = CachedRise(planner, PlanCache(folder)).plan(start, np.random.default_rng(SEED))
    assert isinstance(plan, KeptPlan)
    return plan, folder


@pytest.fixture
def cache(solved, tmp_path) -> PlanCache:
    """A cache of its own with the solved rise."""
    return PlanCache(Path(shutil.copytree(solved[1], tmp_path / "plans")))


@pytest.fixture
def counting(world, database, solved) -> CountingPlanner:
    return CountingPlanner(world, database, answer=solved[0])


def perturb(start: Posture, angle: float, seed: int = 1) -> Posture:
    """Change every joint by a normal error [rad], and move it to another place and heading."""
    error = np.random.default_rng(seed).normal(scale=angle, size=len(start.joint_pos))
    turned = quaternion.multiply(quaternion.from_yaw(2.0), start.orientation)
    return replace(
        start,
        position=start.position + np.array([0.5, -0.3, 0.0]),
        orientation=turned,
        joint_pos=start.joint_pos + error,
    )


def test_a_first_rise_is_the_planners_own_and_is_kept(solved, planner, start):
    plan, folder = solved
    own = planner.plan(start, np.random.default_rng(SEED))
    assert plan.nearness is None
    assert plan.figures().plan_cache is None
    assert (plan.robust, plan.rollouts, plan.rounds) == (own.robust, own.rollouts, own.rounds)
    np.testing.assert_array_equal(plan.motion.joint_target, own.motion.joint_target)
    (entry,) = PlanCache(folder).read("op3").entries
    assert entry.rise.stand_time == own.stand_time
    assert entry.rise.connection == own.connection.motion.name


def test_the_same_start_again_gives_the_same_motion_after_one_rollout(
    cache, counting, solved, start
):
    again = CachedRise(counting, cache).plan(start, np.random.default_rng(7))
    assert counting.states == []
    assert isinstance(again, KeptPlan)
    assert again.nearness is not None
    assert again.nearness.is_same
    assert (again.status, again.rollouts, again.rounds) == (RiseStatus.STOOD, 1, 0)
    first = solved[0]
    for name in ("time", "position", "orientation", "joint_pos", "joint_target"):
        np.testing.assert_array_equal(getattr(again.motion, name), getattr(first.motion, name))
    assert (again.stand_time, again.robust) == (first.stand_time, first.robust)
    assert again.connection.motion.name == first.connection.motion.name
    figures = again.figures().plan_cache
    assert figures is not None
    assert figures.entry == first.entry.name
    assert (figures.distance, figures.joint_rad, figures.tilt_rad) == (0.0, 0.0, 0.0)
    assert figures.age_s >= 0.0


@pytest.mark.parametrize(("name", "planned"), [(FOUND, 1), ("removed", 2)])
def test_a_rise_along_a_found_motion_is_used_again_and_one_along_a_removed_motion_is_not(
    counting, solved, start, tmp_path, name: str, planned: int
):
    joined = solved[0].connection
    counting.answer = replace(
        solved[0], connection=replace(joined, motion=replace(joined.motion, name=name))
    )
    cached = CachedRise(counting, PlanCache(tmp_path / "plans"))
    cached.plan(start, np.random.default_rng(0))
    again = cached.plan(start, np.random.default_rng(1))
    assert len(counting.states) == planned
    assert again.connection.motion.name == name
    assert (again.nearness is not None) == (name == FOUND)


def test_a_near_start_elsewhere_is_checked_in_disturbed_worlds(cache, counting, start, op3):
    near = perturb(start, np.radians(2.0))
    plan = CachedRise(counting, cache).plan(near, np.random.default_rng(0))
    assert counting.states == []
    assert isinstance(plan, KeptPlan)
    assert plan.rollouts == NEAR_CHECKS
    assert 0.0 < plan.nearness.distance < MOST_DISTANCE
    assert plan.nearness.joint == pytest.approx(np.abs(near.joint_pos - start.joint_pos).max())
    within = np.clip(near.joint_pos, op3.lower, op3.upper)
    np.testing.assert_allclose(plan.motion.joint_pos[0], within, atol=1e-9)
    np.testing.assert_allclose(plan.motion.position[0], near.position, atol=1e-9)
    turned = plan.motion.orientation[0]
    assert quaternion.angle_between(turned, near.orientation) < 1e-6
    reach = op3.max_velocity * op3.control_period
    steps = np.diff(plan.motion.joint_target, axis=0, prepend=near.joint_pos[None])
    assert np.all(np.abs(steps) <= reach + 1e-9)


def test_a_motion_is_turned_and_shifted_as_one_piece(solved, start, op3):
    motion = solved[0].motion
    moved = fit(motion, perturb(start, 0.02), op3)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(moved.position, axis=0), axis=1),
        np.linalg.norm(np.diff(motion.position, axis=0), axis=1),
        atol=1e-12,
    )
    np.testing.assert_allclose(moved.position[:, 2], motion.position[:, 2], atol=1e-12)
    tilt = aligned_orientation_distance(moved.orientation, motion.orientation)
    assert np.max(tilt) < 1e-7
    late = motion.time > 1.0
    np.testing.assert_array_equal(moved.joint_pos[late], motion.joint_pos[late])
    np.testing.assert_allclose(moved.joint_target[late], motion.joint_target[late], atol=1e-12)
    assert fit(motion, start, op3) is motion


def test_a_start_that_is_not_near_is_planned_and_kept_beside(cache, counting, start):
    far = perturb(start, np.radians(15.0))
    CachedRise(counting, cache).plan(far, np.random.default_rng(0))
    assert len(counting.states) == 1
    assert len(cache.read("op3").entries) == 2


@pytest.mark.parametrize(
    "options",
    [
        {"torque_limit": TorqueLimit(2.5)},
        {"torque_limit": TorqueLimit(None, "pwm")},
        {"options": PlannerOptions(planning=False)},
        {"options": PlannerOptions(assistance=0.0)},
    ],
    ids=str,
)
def test_a_plan_serves_only_under_the_limit_and_settings_of_its_own(
    cache, world, database, solved, start, options
):
    other = CountingPlanner(world, database, answer=solved[0], **options)
    CachedRise(other, cache).plan(start, np.random.default_rng(0))
    assert len(other.states) == 1
    assert len(cache.read("op3").entries) == 2


def _change_last(database: MotionDatabase, name: str) -> MotionDatabase:
    """Change one number of the last motion by less than a tick."""
    changed = getattr(database.motions[-1], name).copy()
    changed[-1, 0] += 1e-4
    last = replace(database.motions[-1], **{name: changed})
    return MotionDatabase([*database.motions[:-1], last], database.metric)


def test_what_a_plan_depends_on_changes_the_fingerprint(world, database, planner, op3):
    scene = world.scene
    slippery = World(op3, replace(scene, surface=Surface(friction=0.5)))
    fewer = MotionDatabase(list(database.motions[1:]), database.metric)
    known = {
        compute_fingerprint(PlannedRise(slippery, database)),
        compute_fingerprint(PlannedRise(world, fewer)),
        compute_fingerprint(PlannedRise(world, database, options=PlannerOptions(planning=False))),
        compute_fingerprint(planner),
        compute_fingerprint(PlannedRise(world, _change_last(database, "joint_target"))),
        compute_fingerprint(PlannedRise(world, _change_last(database, "joint_pos"))),
        compute_fingerprint(PlannedRise(World(reshape(op3, Body(arms=1.6))), database)),
        compute_fingerprint(PlannedRise(World(reshape(op3, Body(arms=1.7))), database)),
    }
    assert len(known) == 8
    assert compute_fingerprint(PlannedRise(World(op3))) == compute_fingerprint(planner)


def test_beside_obstacles_only_the_same_place_and_heading_count(
    op3, database, solved, start, tmp_path
):
    foot = np.full(3, 9.0)
    far_post = make_capsule("post", foot, foot + np.array([0.0, 0.0, 1.0]), 0.05)
    world = World(op3, replace(FLAT_SCENE, name="post", obstacles=(far_post,)))
    planner = CountingPlanner(world, database, answer=solved[0])
    cached = CachedRise(planner, PlanCache(tmp_path))
    cached.plan(start, np.random.default_rng(0))
    assert isinstance(cached.plan(start, np.random.default_rng(0)), KeptPlan)
    assert len(planner.states) == 1
    moved = replace(start, position=start.position + np.array([0.1, 0.0, 0.0]))
    turn = quaternion.from_yaw(0.1)
    turned = replace(start, orientation=quaternion.multiply(turn, start.orientation))
    for other in (moved, turned):
        planner.states.clear()
        cached.plan(other, np.random.default_rng(0))
        assert len(planner.states) == 1


def test_a_kept_plan_that_does_not_stand_is_not_used_and_changes_no_fresh_one(
    cache, counting, solved, start
):
    (entry,) = cache.read().entries
    still = np.tile(solved[0].motion.joint_target[0], (len(solved[0].motion.time), 1))
    cache.keep(entry.rise, replace(solved[0].motion, joint_target=still))
    plan = CachedRise(counting, cache).plan(start, np.random.default_rng(5))
    assert counting.states == [dict(np.random.default_rng(5).bit_generator.state)]
    assert plan.nearness is None
    (entry,) = cache.read().entries
    np.testing.assert_array_equal(entry.load_motion().joint_target, plan.motion.joint_target)


def test_a_plan_that_fell_in_some_disturbed_worlds_serves_its_own_start_alone(
    cache, counting, start
):
    (entry,) = cache.read().entries
    cache.keep(replace(entry.rise, robust=0.9), entry.load_motion())
    cached = CachedRise(counting, cache)
    again = cached.plan(start, np.random.default_rng(0))
    assert (again.robust, counting.states) == (0.9, [])
    cached.plan(perturb(start, 0.01), np.random.default_rng(0))
    assert len(counting.states) == 1


def test_damage_is_reported_once_and_the_rise_is_planned(cache, counting, start, tmp_path):
    (entry,) = cache.read().entries
    other = entry.file.with_name("0123456789abcdef.json")
    other.write_text("{")
    entry.motion_file.write_bytes(b"PK\x03\x04 and no more")
    problems: list[str] = []
    cached = CachedRise(counting, cache, report=problems.append)
    for _ in range(2):
        assert cached.plan(start, np.random.default_rng(0)).status is RiseStatus.STOOD
    assert len(counting.states) == 1  # the fresh plan has replaced the damaged one
    assert [
        str(file) in problem
        for file, problem in zip((other, entry.motion_file), problems, strict=True)
    ] == [True, True]
    (tmp_path / "file").touch()
    problems.clear()
    blocked = CachedRise(counting, PlanCache(tmp_path / "file"), report=problems.append)
    assert blocked.plan(start, np.random.default_rng(0)).status is RiseStatus.STOOD
    assert problems
    assert all("Not a directory" in problem or "File exists" in problem for problem in problems)


def test_an_answer_without_a_motion_is_not_kept(world, database, start, tmp_path):
    fell = RisePlan(status=RiseStatus.FELL)
    cached = CachedRise(CountingPlanner(world, database, answer=fell), PlanCache(tmp_path))
    assert cached.plan(start, np.random.default_rng(0)) is fell
    assert list(tmp_path.iterdir()) == []


def test_a_plan_that_the_preflight_refuses_leaves_the_cache(world, database, start, tmp_path):
    """Without that, every further attempt would begin with it again."""
    wrong: Motion = next(m for m in database.rising if m.start_class == "supine")
    refused = MotionPlan(
        status=RiseStatus.STOOD,
        motion=wrong,
        connection=database.select(start, 1)[0],
        stand_time=2.0,
        robust=1.0,
    )
    planner = CountingPlanner(world, database, answer=refused)
    cache = PlanCache(tmp_path)
    with Twin(world, start) as twin:
        options = SessionOptions(settle=False)
        result = get_up(twin, CachedRise(planner, cache), max_attempts=1, options=options)
    assert result.status is AttemptStatus.NEEDS_HELP
    assert "preflight refused" in result.reason
    assert len(planner.states) == MOST_PLANS
    assert cache.read().entries == ()
