"""From a name to a strategy: one way for commands and benchmarks, under one torque limit."""

import numpy as np
import pytest

from humanoid_getup.strategies.choice import (
    NEAREST,
    PLAN,
    STRAIGHT,
    StrategyRequest,
    choose_strategy,
    make_strategy,
)
from humanoid_getup.strategies.learned_rise import LearnedRise, PolicyPlan
from humanoid_getup.strategies.plan import RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.stored_motion import NearestMotion
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
    strategy = make_strategy(world, name, torque_limit=LIMIT, database=database)
    assert isinstance(strategy, kind)
    assert strategy.world is world
    assert strategy.torque_limit == LIMIT
    if isinstance(strategy, LearnedRise):
        assert (strategy.name, strategy.policy.torque_limit) == (name, LIMIT.value)
    if isinstance(strategy, PlannedRise):
        assert strategy.options.planning is strategy.options.filtering is (name == PLAN)


def test_a_style_brings_the_policy_that_follows_it(world, supine):
    request = StrategyRequest(method="policy", style="side-sit")
    plan = choose_strategy(world, request).plan(supine, np.random.default_rng(0))
    assert isinstance(plan, PolicyPlan)
    assert plan.status is RiseStatus.LEARNED
    assert plan.title == "policy styled, style side-sit"
