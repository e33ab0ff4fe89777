"""Holding the stance: what is said of a robot that stays up, falls, or becomes hot."""

import re
from dataclasses import replace

import numpy as np
import pytest
from records import make_record

from drivers.twin.servo_model import Windings
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import Stance
from humanoid_getup.robot_check import hold_check
from humanoid_getup.robot_check.finding import CheckFinding
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place
from robots.quaternion import Array

CYCLES = 5
KNEE = "l_knee"


@pytest.fixture
def check(world: World, monkeypatch: pytest.MonkeyPatch):
    """Check a stance whose record is made up."""

    def check_record(record: Record) -> list[CheckFinding]:
        monkeypatch.setattr(hold_check, "play", lambda *_: record)
        return [*hold_check.check_hold(world)]

    return check_record


def hold(world: World, torque: Array, **changes) -> Record:
    """Make the record of a stance that takes torques (n,) [N·m]."""
    robot = world.robot
    shape = (1, CYCLES)
    qpos = np.tile(place(robot, world.model, robot.standing), (*shape, 1))
    return make_record(
        robot,
        shape,
        robot.control_period,
        **{"qpos": qpos, "torque": np.tile(torque, (*shape, 1))} | changes,
    )


def strain(robot: Robot, torque: float) -> Array:
    """Return torques (n,) that are there at one knee alone [N·m]."""
    return np.where(np.array(robot.joint_names) == KNEE, torque, 0.0)


def test_op3_holds_its_stance_in_simulation(world: World):
    held, cool = hold_check.check_hold(world)
    assert (held.level, cool.level) == ("ok", "ok")


@pytest.mark.parametrize(("share", "level"), [(0.85, "ok"), (0.95, "warning")])
def test_a_servo_near_its_stall_torque_is_a_warning(share: float, level: str, world: World, check):
    stall = world.robot.max_torque[world.robot.joint_names.index(KNEE)]
    held = check(hold(world, strain(world.robot, share * stall)))[0]
    assert (held.level, "stall torque trips" in held.remedy) == (level, level == "warning")


def test_a_fall_is_reported_with_height_and_tilt_and_nothing_of_heat(world: World, check):
    shape = (1, CYCLES)
    stance = Stance(
        neck_height=np.full(shape, 0.4 * world.robot.standing_neck_height),
        tilt=np.full(shape, np.radians(80.0)),
        non_foot_contact=np.ones(shape, dtype=bool),
    )
    upright = np.arange(CYCLES)[None] < CYCLES - 1  # it falls at the very end
    (found,) = check(hold(world, strain(world.robot, 4.0), stance=stance, upright=upright))
    assert found.level == "fault"
    text = "does not hold for 3 s on its servos (XM430-W350): neck at 40% of its height, tilted by"
    assert f"{text} 80°" in str(found)
    assert "change [standing]" in found.remedy


def test_servos_that_are_too_weak_for_the_stance_are_to_blame(world: World, monkeypatch):
    """With twice their torque it stands: the fault rests on their types, which may be guessed."""

    def play(played: World, *_) -> Record:
        is_strong = played.robot.max_torque.max() > world.robot.max_torque.max()
        upright = np.full((1, CYCLES), is_strong)
        return hold(world, strain(world.robot, 4.0), upright=upright)

    monkeypatch.setattr(hold_check, "play", play)
    (found,) = hold_check.check_hold(world)
    assert (found.level, "it holds with twice the torque" in found.remedy) == ("fault", True)


def test_a_hot_servo_is_reported_and_when_it_switches_itself_off(world: World, check):
    """The time is that after which the servo model, stepped second by second, is at its limit."""
    robot, torque = world.robot, strain(world.robot, 2.5)
    _, found = check(hold(world, torque))
    assert (found.level, found.subject) == ("warning", f"joint '{KNEE}'")
    minutes = re.search(r"switches itself off after (\d+) min", found.text)
    assert minutes
    windings, knee, seconds = Windings(robot), robot.joint_names.index(KNEE), 0
    limit = robot.joints[knee].servo.model.temperature_limit
    while windings.temperature[knee] < limit:
        windings.heat(windings.compute_current(torque), 1.0)
        seconds += 1
    assert int(minutes[1]) == pytest.approx(seconds / 60.0, abs=0.6)


def test_the_stance_is_held_a_second_longer_than_a_stand_takes(world: World, monkeypatch):
    asked = []

    def play(_, __, targets: Array) -> Record:
        asked.append(targets)
        return hold(world, np.zeros(world.robot.n))

    monkeypatch.setattr(hold_check, "play", play)
    [*hold_check.check_hold(replace_period(world, 0.01))]
    (targets,) = asked
    assert targets.shape == (1, 400, world.robot.n)
    assert np.ptp(targets, axis=1) == pytest.approx(0.0)


def replace_period(world: World, period: float) -> World:
    return World(replace(world.robot, control_period=period))
