"""A policy follows the curves of what was planned, in the world it was planned in."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise, StyledRise, read_curves
from humanoid_getup.strategies.plan import Plan, RiseStatus
from robots import Robot


@dataclass
class Planner:
    made: Plan

    def plan(self, _start, _rng) -> Plan:
        return self.made


@pytest.fixture(scope="module")
def motion(op3: Robot) -> Motion:
    return next(m for m in load_database(op3).motions if m.name == "prone_push_up_fast")


@pytest.fixture(scope="module")
def learned(world: World) -> LearnedRise:
    return LearnedRise(world, "styled")


def plan_of(motion: Motion) -> Plan:
    return Plan(status=RiseStatus.STOOD, motion=motion, planned=True, plan_s=0.5)


def rise(learned: LearnedRise, made: Plan, start) -> Plan:
    return StyledRise(learned, Planner(made)).plan(start, np.random.default_rng(0))


def test_the_policy_follows_the_curves_of_the_plan(world, learned, motion):
    plan = rise(learned, plan_of(motion), motion.posture(0))
    assert (plan.status, plan.planned, plan.plan_s) == (RiseStatus.LEARNED, True, 0.5)
    (curves,) = plan.policy.style.curves
    assert curves.duration == pytest.approx(motion.time[-1] - motion.time[0])
    assert np.array_equal(curves.points, read_curves(world, motion).points)
    assert learned.policy.style.name == "any"  # its own is left alone


def test_a_motion_that_does_not_stand_up_has_nothing_to_follow(learned, motion):
    squat = replace(motion, position=motion.position * [1.0, 1.0, 0.7])
    plan = rise(learned, plan_of(squat), motion.posture(0))
    assert plan.status is RiseStatus.FELL
    assert "the neck ends at" in plan.detail
    assert plan.controller(learned) is None
