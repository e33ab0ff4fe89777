"""From a name to a strategy: one way for commands and benchmarks, under one torque limit."""

import numpy as np
import pytest
from nonempty import nonempty

from drivers import Twin
from humanoid_getup.motions.motion_database import find_lying_down, load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies import plan as plans
from humanoid_getup.strategies.choice import (
    NEAREST,
    PLAN,
    STRAIGHT,
    choose_strategy,
    make_strategy,
)
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.stored_motion import NearestMotion, StoredMotion
from robots import TorqueLimit

LIMIT = TorqueLimit(2.5, "pwm")


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        (PLAN, PlannedRise),
        (STRAIGHT, PlannedRise),
        (NEAREST, NearestMotion),
        ("robust", LearnedRise),
    ],
)
def test_every_name_makes_a_strategy_under_the_limit(world, database, name, kind):
    strategy = make_strategy(world, name, PlannerSettings(torque_limit=LIMIT), database=database)
    assert isinstance(strategy, kind)
    assert strategy.world is world
    assert strategy.torque_limit == LIMIT
    if isinstance(strategy, LearnedRise):
        assert (strategy.name, strategy.policy.torque_limit) == (name, LIMIT.value)
    if isinstance(strategy, PlannedRise):
        assert strategy.settings.planning is strategy.settings.filtering is (name == PLAN)


def test_a_style_brings_the_policy_that_follows_it(world, supine):
    strategy = choose_strategy(world, "policy", style="side-sit")
    plan = strategy.plan(supine, np.random.default_rng(0))
    assert isinstance(plan, Plan)
    assert plan.status is RiseStatus.LEARNED
    assert plan.title == "policy styled, style side-sit"


RNG = np.random.default_rng(0)


def test_a_motion_that_does_not_rise_is_refused_by_its_end(world: World):
    down = find_lying_down(world.robot)
    with pytest.raises(ValueError, match=f"ends lying {down.end_class}, expected one that ends"):
        StoredMotion(world, down)


def test_a_motion_is_its_own_nearest_from_where_it_may_be_entered(world: World):
    database = load_database(world.robot)
    strategy = NearestMotion(world, database)
    for motion in nonempty(database.rising[:4]):
        plan = strategy.plan(motion.posture(int(motion.entry_frames[0])), RNG)
        assert plan.connection is not None and plan.connection.distance < 1e-6
        assert plan.motion is plan.connection.motion


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize("rises", [True, False])
@pytest.mark.parametrize("balanced", [True, False])
def test_player_preflight_and_report_agree_on_balance(
    world, op3, monkeypatch, simulated, rises, balanced
):
    rising = load_database(op3).rising[0]
    motion = rising if rises else find_lying_down(op3)
    plan = Plan(status=RiseStatus.STORED, motion=motion, tracked=simulated, balanced=balanced)
    strategy = StoredMotion(world, rising)
    given = []
    monkeypatch.setattr(plans, "preflight", lambda *_, **options: given.append(options["balanced"]))
    player = MotionPlayer.__init__
    made = []

    def make(self, *args, balance=None, **options):
        made.append(balance is not None)
        player(self, *args, balance=balance, **options)

    monkeypatch.setattr(MotionPlayer, "__init__", make)
    with Twin(world) as twin:
        plan.preflight(strategy, twin.read(), twin.read)
    plan.controller(strategy)
    expected = simulated and rises and balanced
    assert given == [expected]
    assert made == [expected]
    assert plan.is_balanced is expected
    assert (plan.open_loop() is None) is not expected
