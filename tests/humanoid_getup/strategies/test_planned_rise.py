from dataclasses import replace

import numpy as np
import pytest
from stored_plans import lie_at_start

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.motions.preference import Preference
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.strategies.free_rise import FreeRise
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.rise_search import FoundRise
from robots import TorqueLimit
from robots.kinematics import place


@pytest.fixture(scope="module")
def plan(world, database, supine):
    return PlannedRise(world, database).plan(supine, np.random.default_rng(0))


def test_a_supine_fall_is_planned_and_stands(plan):
    assert plan.status is RiseStatus.STOOD
    assert plan.planned
    assert plan.robust >= 0.8
    assert 1.0 < plan.rollout.stand_time < 8.0


def test_a_plan_says_where_the_robot_lay_and_what_its_rollout_took(plan):
    assert plan.motion.start_class == "supine"
    settings = plan.settings
    assert (settings.prefer, settings.search_budget, plan.searched) == ("time", 600.0, 0)
    assert 0.3 < plan.rollout.rms_torque < plan.rollout.peak_torque <= 4.1
    assert plan.before is None
    assert str(plan).startswith(f"{plan.title}: a rollout ends in a held stand, stands in ")


def test_a_rise_begins_where_the_robot_lies_and_ends_in_the_stance(plan, supine, op3):
    motion = plan.motion
    np.testing.assert_allclose(motion.joint_pos[0], supine.joint_pos, atol=1e-6)
    reach = op3.max_velocity * op3.control_period
    assert np.all(np.abs(motion.joint_target[0] - supine.joint_pos) <= reach)
    np.testing.assert_allclose(motion.joint_target[-1], op3.standing.joint_pos, atol=1e-6)


def test_a_plan_depends_on_start_and_seed_alone(world, database, supine, plan):
    """A planner that has planned another rise, and is watched, plans this one as a new one does."""
    seen = list[str]()
    monitor = ProgressMonitor(lambda progress: seen.append(str(progress)))
    planner = PlannedRise(world, database, monitor=monitor)
    other = planner.plan(lie_at_start(world), np.random.default_rng(1))
    assert other.rollouts > 0
    seen.clear()
    again = planner.plan(supine, np.random.default_rng(0))
    assert (again.rollouts, again.rounds, again.robust) == (plan.rollouts, plan.rounds, plan.robust)
    np.testing.assert_array_equal(again.motion.joint_target, plan.motion.joint_target)
    np.testing.assert_array_equal(again.motion.position, plan.motion.position)
    paths = [line for line in seen if line.startswith("planning a path to ")]
    assert seen[: len(paths)] == paths
    joined = plan.connection
    assert f"planning a path to {joined.motion.name}, frame {joined.frame}" in paths
    assert seen[len(paths)] == f"tracking {len(paths)} candidates in physics"
    assert "checking a rise in 16 disturbed worlds" in seen


@pytest.mark.parametrize("steps", [1, 4])
def test_a_plan_that_is_cancelled_ends_with_the_step(world, database, supine, steps: int):
    seen = list[Progress]()
    monitor = ProgressMonitor(seen.append, lambda: len(seen) >= steps)
    planner = PlannedRise(world, database, monitor=monitor)
    with pytest.raises(CancelledError):
        planner.plan(supine, np.random.default_rng(0))
    assert len(seen) == steps


@pytest.mark.parametrize(
    ("limit", "searched", "advice"),
    [
        (None, 0.0, ""),
        (2.5, 90.0, "than 2.5 N·m or a longer --search-budget than 60 s"),
    ],
)
def test_a_plan_that_falls_says_what_may_help(
    world, database, supine, monkeypatch: pytest.MonkeyPatch, limit, searched: float, advice: str
):
    planner = PlannedRise(
        world, database, PlannerSettings(torque_limit=TorqueLimit(limit), search_budget=60.0)
    )

    def search(*_: object) -> FoundRise:
        planner.filter.searched += searched
        return FoundRise(rolled_out=True, highest=0.1, joined="squat")

    monkeypatch.setattr(FreeRise, "search", search)
    reason = planner.plan(supine, np.random.default_rng(0)).reason
    assert reason.endswith(advice)
    assert ("next: " in reason) == bool(advice)


def test_a_side_without_motion_is_named_where_planning_fails(world, database, monkeypatch):
    prone = [motion for motion in database.rising if motion.start_class == "prone"]
    planner = PlannedRise(world, MotionDatabase(prone, PostureMetric.of(world.robot)))
    found = FoundRise(rolled_out=True)
    monkeypatch.setattr(FreeRise, "search", lambda *_: found)
    starts = {"supine": (0.7, 0.0, -0.7, 0.0), "prone": (0.7, 0.0, 0.7, 0.0)}
    posture = replace(world.robot.standing, position=np.array([0.0, 0.0, 0.1]))
    for side, orientation in starts.items():
        start = replace(posture, orientation=np.array(orientation) / np.linalg.norm(orientation))
        reason = planner.plan(start, np.random.default_rng(0)).reason
        assert ("has no motion from supine; next: getup motions discover" in reason) == (
            side == "supine"
        )
    assert planner.describe_gap(None) == planner.describe_gap("supine.json") == ""


def test_an_interrupted_plan_says_what_it_has_found(world, database, supine, monkeypatch):
    def interrupt(*_args, **_options):
        raise KeyboardInterrupt

    planner = PlannedRise(world, database)
    monkeypatch.setattr(planner.filter, "separate", interrupt)
    with pytest.raises(KeyboardInterrupt, match=r"planning was in round 1, none stands yet; the b"):
        planner.plan(supine, np.random.default_rng(0))


def test_without_filter_the_path_and_the_motion_come_out_as_they_are(world, database, supine):
    raw = PlannedRise(world, database, PlannerSettings(filtering=False)).plan(
        supine, np.random.default_rng(0)
    )
    assert raw.status is RiseStatus.UNFILTERED
    assert raw.rollouts == 0
    joined = raw.connection.motion
    tail = joined.joint_target[raw.connection.frame :]
    np.testing.assert_array_equal(raw.motion.joint_target[-len(tail) :], tail)


@pytest.mark.slow  # half a minute
def test_servos_too_weak_to_rise_give_an_answer_not_a_motion(world, database, supine):
    planner = PlannedRise(world, database, PlannerSettings(torque_limit=TorqueLimit(0.15)))
    weak = planner.plan(supine, np.random.default_rng(0))
    assert weak.status is RiseStatus.FELL
    assert not isinstance(weak, Plan)
    assert weak.title == ""
    assert "neck" in weak.reason


@pytest.mark.slow
def test_a_rise_that_prefers_torque_costs_less_of_it_and_stands_as_often(
    world, database, plan, supine
):
    planner = PlannedRise(world, database, PlannerSettings(prefer="torque", search_budget=200.0))
    gentle = planner.plan(supine, np.random.default_rng(1))
    assert gentle.robust >= plan.robust
    assert gentle.searched > 0.0
    assert gentle.before is not None
    weigh = Preference.of("torque").cost
    assert weigh(gentle.rollout) < weigh(gentle.before)

    start = place(world.robot, world.model, supine)[None]
    nominal = Scenarios(starts=start, parameters=DomainParameters.nominal(world, 1))
    motions = [plan.motion.joint_target, gentle.motion.joint_target]
    outcome = Experiment(world).compare(nominal, motions)
    quick, cheap = weigh(outcome)[:, 0]
    assert cheap < quick


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"prefer": "luck"}, r"prefer is 'luck', expected one of time, torque"),
        ({"search_budget": 0.0}, r"search_budget is 0.0 s, expected above 0 s"),
        ({"search_budget": float("inf")}, "search_budget is inf s, expected above 0 s, at most"),
    ],
)
def test_a_wrong_preference_or_budget_is_refused(world, database, options, message):
    with pytest.raises(ValueError, match=message):
        PlannedRise(world, database, PlannerSettings(**options))
