"""Key postures: kept where physics permits, dropped with a reason where it does not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stored_plans import lie_at_start

from drivers import Twin
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.motions.motion_database import KeyPosture, find_motion, load_key
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.key_routes import find_stretches
from humanoid_getup.strategies.keyed_rise import CLOSE_JOINT, find_passes
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, quaternion
from robots.kinematics import place, place_postures

PROPPED = "motions:supine_sit_up_gentle@1.2"


@pytest.fixture(scope="module")
def propped(op3: Robot) -> KeyPosture:
    return load_key(PROPPED, op3)


@pytest.fixture(scope="module")
def planner(world: World, propped: KeyPosture) -> PlannedRise:
    return PlannedRise(world, keys=[propped])


@pytest.fixture(scope="module")
def start(world: World) -> Posture:
    """A robot that lies where the motion of the key begins."""
    return lie_at_start(world, "supine_sit_up_gentle")


@pytest.fixture(scope="module")
def plan(planner: PlannedRise, start: Posture) -> Plan:
    return planner.plan(start, np.random.default_rng(0))


def test_a_reachable_key_is_kept_and_the_robot_stands(plan: Plan):
    (key,) = plan.keys
    assert plan.status is RiseStatus.STOOD
    assert plan.robust == 1.0
    figures = key.figures
    assert (figures.name, figures.kept, figures.reason) == (PROPPED, True, "")
    assert figures.largest_joint_error_rad is not None
    assert figures.largest_joint_error_rad < CLOSE_JOINT
    assert figures.time_s is not None
    assert 0.3 < figures.time_s < plan.rollout.stand_time


def test_the_twin_passes_through_the_key_and_stands(plan, planner, propped, world, start):
    class Planned:
        world, torque_limit = planner.world, planner.torque_limit

        def plan(self, _start: Posture, _rng: np.random.Generator) -> Plan:
            return plan

    with Twin(world, start) as twin:
        result = get_up(twin, Planned())
    assert result.stood
    (one,) = find_passes(world, result.outcome.qpos, [propped.posture])
    assert one.largest < CLOSE_JOINT


@pytest.mark.slow
def test_an_impossible_key_is_dropped_with_a_reason_and_the_robot_stands(world, supine, op3):
    over = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.pi)
    headstand = replace(
        op3.standing, orientation=quaternion.multiply(op3.standing.orientation, over)
    )
    plan = PlannedRise(world, keys=[headstand]).plan(supine, np.random.default_rng(0))
    (key,) = plan.keys
    assert plan.status is RiseStatus.STOOD
    figures = key.figures
    assert (figures.name, figures.kept, figures.time_s) == ("key 1", False, None)
    assert figures.reason


@settings(max_examples=10)
@given(frames=st.lists(st.integers(0, 200), min_size=1, max_size=3))
def test_a_motion_passes_through_its_own_frames_in_order(world, op3, frames):
    motion = find_motion(op3, "supine_roll_over")
    qpos = place_postures(op3, world.model, motion.position, motion.orientation, motion.joint_pos)
    passes = find_passes(world, qpos, [motion.posture(frame) for frame in sorted(frames)])
    assert [one.frame for one in passes] == sorted(one.frame for one in passes)
    for one in passes:
        assert one.distance < 1e-6
    there_and_back = find_passes(world, qpos, [motion.posture(f) for f in (200, 0)])
    assert there_and_back[0].frame <= there_and_back[1].frame
    assert max(one.distance for one in there_and_back) > 1.0


def test_a_key_upside_down_is_not_passed_by_its_joints_alone(world: World, op3: Robot):
    over = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.pi)
    upside_down = replace(
        op3.standing, orientation=quaternion.multiply(over, op3.standing.orientation)
    )
    qpos = place(op3, world.model, op3.standing)[None]
    (one,) = find_passes(world, qpos, [upside_down])
    assert one.largest == pytest.approx(0.0)
    assert one.tilt == pytest.approx(np.pi)
    assert one.distance > 1.0


def test_the_stretch_that_leads_to_a_frame_of_a_motion_is_from_that_motion(database):
    motion = next(m for m in database.rising if m.name == "prone_push_up_gentle")
    frame = len(motion.time) // 2
    best = find_stretches(database, motion.posture(0), motion.posture(frame), 3)[0]
    assert (best.motion.name, best.first, best.last) == (motion.name, 0, frame)
    assert best.distance == pytest.approx(0.0, abs=1e-6)


def test_stretches_are_one_of_each_motion_the_nearest_first_and_begin_where_it_may_be_entered(
    database,
):
    start, key = database.rising[0].posture(0), database.rising[0].posture(60)
    found = find_stretches(database, start, key, 100)
    assert len({one.motion.name for one in found}) == len(found)
    assert np.all(np.diff([one.distance for one in found]) >= 0.0)
    assert all(one.first in one.motion.entry_frames and one.first < one.last for one in found)
    assert find_stretches(database, start, key, 2) == found[:2]
