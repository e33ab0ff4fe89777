"""A session knows its robot: behind a guard, judged by what is known, paced by what it is."""

from dataclasses import replace

import pytest

from drivers import SafetyGuard, Twin
from drivers.dynamixel.backend import DynamixelBackend
from humanoid_getup.execution.session import Session, SessionOptions
from humanoid_getup.experiments.judging.judge import GroundTruthJudge, JointJudge, SensorJudge
from humanoid_getup.simulation.world import World
from robots import Robot, TorqueLimit


def test_a_simulated_robot_goes_limp_and_runs_as_fast_as_it_can(world: World):
    session = Session.on(Twin(world), world)
    assert (session.then, session.realtime, session.services) == ("limp", False, None)
    assert isinstance(session.make_judge(), GroundTruthJudge)


def test_a_robot_on_servos_is_held_in_real_time(op3: Robot, world: World):
    driver = DynamixelBackend(op3, {"main": "/dev/none"})
    session = Session.on(driver, world)
    assert (session.then, session.realtime, session.services) == ("hold", True, driver)
    assert session.locate is None
    assert isinstance(session.make_judge(), SensorJudge)


def test_no_backend_is_without_a_guard_under_the_limit(world: World):
    session = Session.on(Twin(world), world, TorqueLimit(2.0, "pwm"))
    assert isinstance(session.guard, SafetyGuard)
    assert session.guard.limits.torque_limit.max() == pytest.approx(2.0)


def test_without_an_imu_no_stand_is_claimed_and_nothing_lies_down(op3: Robot, world: World):
    options = SessionOptions(then="hold", assumed_start=op3.standing)
    session = Session.on(Twin(world), world, options=options)
    assert not session.has_imu
    assert not session.lies_down
    assert isinstance(session.make_judge(), JointJudge)
    assert session.make_judge().end() is None
    assert replace(session, assumed_start=None).lies_down


def test_only_in_scenes_that_differ_from_place_to_place_the_twin_says_where_it_lies(op3: Robot):
    walled, flat = World(op3, "wall"), World(op3)
    assert Session.on(Twin(flat), flat).locate is None
    locate = Session.on(Twin(walled), walled).locate
    assert locate is not None
    assert (locate().x, locate().y) == pytest.approx(op3.standing.position[:2])
