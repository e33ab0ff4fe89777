"""The checks of a model and of its stance, on robots small enough to print."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from records import make_record
from tiny_robots import LEGS, limb, make_robot

from drivers.twin.device_models import Windings
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import Stance
from humanoid_getup.robot_check import stance_check
from humanoid_getup.robot_check.model_check import (
    CheckFinding,
    check_body,
    check_mirrors,
    check_turns,
)
from humanoid_getup.robot_check.stance_check import check_soles, check_stance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.limbs import Limbs
from robots.kinematics import place
from robots.quaternion import Array

ARMS = "".join(
    limb(f"{s}_arm", f"0 {y} 0.15", inside=limb(f"{s}_elbow", "0 0 -0.1"))
    for s, y in (("l", 0.1), ("r", -0.1))
)


@pytest.fixture
def limbs(tmp_path: Path) -> Limbs:
    return Limbs(make_robot(tmp_path, LEGS + ARMS))


def test_a_robot_lighter_than_its_servos_is_named(tmp_path: Path):
    light = (LEGS + ARMS).replace('mass="0.1"', 'mass="0.01"')
    (found, *_) = check_body(Limbs(make_robot(tmp_path, light)))
    # By hand: 8 servos of 82 g; 0.5 kg and 8 links of 10 g.
    assert found.level == "warning"
    assert found.text == "weighs 0.58 kg, less than its 8 servos, 0.66 kg"


@pytest.mark.parametrize(("name", "level"), [("l_arm", "ok"), ("l_knee", "warning")])
def test_a_full_turn_is_named_and_of_a_leg_warned(limbs: Limbs, name: str, level: str):
    assert not [*check_turns(limbs)]
    turned = [
        replace(joint, lower=-np.pi, upper=np.pi) if joint.name == name else joint
        for joint in limbs.robot.joints
    ]
    limbs.robot = replace(limbs.robot, joints=tuple(turned))
    (found,) = check_turns(limbs)
    assert (found.level, found.text) == (level, f"a full turn is that of {name}")


def test_a_neck_below_the_shoulders_is_named(tmp_path: Path):
    high = ARMS.replace("0.15", "0.25")
    texts = [str(found) for found in check_body(Limbs(make_robot(tmp_path, LEGS + high)))]
    assert "site 'neck': is 50 mm below the shoulders, expected above them" in texts[-1]


def test_a_wrong_sign_is_named_with_the_right_one(limbs: Limbs):
    limbs.robot = replace(limbs.robot, mirror_sign=-limbs.robot.mirror_sign)
    found = [*check_mirrors(limbs)]
    assert [each.level for each in found] == ["fault"] * 4
    assert found[0].text == "mirror_sign is -1, but its axis says +1 for its mirror 'r_hip'"


def test_a_joint_without_image_is_named(tmp_path: Path):
    lever = limb("lever", "0 0.15 0.1")
    found = [*check_mirrors(Limbs(make_robot(tmp_path, LEGS + ARMS + lever)))]
    assert [str(each).split(";")[0] for each in found] == [
        "joint 'lever': its mirror is itself, which is not its mirror image in the model"
    ]


def soles_of(folder: Path, old: str = "", new: str = "") -> list[str]:
    assert old in LEGS
    robot = make_robot(folder, LEGS.replace(old, new, 1) if old else LEGS)
    return [f"{found.level}: {found}" for found in check_soles(robot)]


SOLE = '<site name="l_sole" pos="0 0 -0.1"/>'


@pytest.mark.parametrize(
    ("new", "message"),
    [
        (SOLE.replace("-0.1", "-0.09"), "warning: site 'l_sole': is 10 mm above the lowest point"),
        (SOLE.replace("/>", ' euler="10 0 0"/>'), "fault: site 'l_sole': is tilted by 10° against"),
    ],
)
def test_a_sole_that_is_off_its_face_is_named(tmp_path: Path, new: str, message: str):
    (found,) = soles_of(tmp_path, SOLE, new)
    assert found.startswith(message)


def stance_of(robot: Robot) -> list[str]:
    return [str(found) for found in check_stance(World(robot), Limbs(robot))]


def test_a_balanced_stance_has_a_margin(tmp_path: Path):
    """By hand: the mass is over the middle of soles that reach 3 cm forward and back."""
    found = stance_of(make_robot(tmp_path, LEGS))
    assert found == ["stance: the center of mass is 30 mm inside the soles' edge"]


def test_a_load_in_front_of_the_soles_is_a_fault(tmp_path: Path):
    load = '<geom size="0.01" pos="0.2 0 0.1" mass="1"/>'
    found = stance_of(make_robot(tmp_path, LEGS + load))
    # By hand: 1 kg at 0.2 m beside 0.9 kg at 0: 105 mm, 75 beyond the edge.
    assert found[-1].startswith("stance: the center of mass is 75 mm outside the soles, expected")


def test_an_arm_in_the_torso_is_named(tmp_path: Path):
    elbow = limb("arm", "0 0 -0.01")
    shoulder = (
        '<body name="shoulder" pos="0 0.2 0.1"><joint name="swing" axis="0 1 0" range="-9 9"/>'
    )
    shoulder += (
        f'<geom size="0.01" mass="0.01"/>{elbow.replace("0 0 -0.01", "0 -0.16 0.05")}</body>'
    )
    found = stance_of(make_robot(tmp_path, LEGS + shoulder))
    assert "arm_link reaches" in found[0] or "into arm_link" in found[0]


CYCLES = 5
KNEE = "l_knee"


@pytest.fixture
def check(world: World, monkeypatch: pytest.MonkeyPatch):
    def check_record(record: Record) -> list[CheckFinding]:
        monkeypatch.setattr(stance_check, "play", lambda *_: record)
        return [*stance_check.check_hold(world)]

    return check_record


def hold(world: World, torque: Array, **changes) -> Record:
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
    held, cool = stance_check.check_hold(world)
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
        sole_rise=np.zeros(shape),
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

    monkeypatch.setattr(stance_check, "play", play)
    (found,) = stance_check.check_hold(world)
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
