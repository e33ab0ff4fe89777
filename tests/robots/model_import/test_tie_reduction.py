"""Gears and closed loops: the hinge of a motor is welded, the output stays with its torque."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import pytest
from small_humanoid import small_humanoid, small_urdf
from spoiling import spoiled

from robots import load_robot
from robots.body.joint_view import JointView
from robots.description.servo_catalog import servo_models
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.model_import.robot_folder import write_robot

GEAR = 2.5  # turns of the motor to one of the knee
TORQUE = 1.6  # N·m of the motor


def add_motor(spec: mujoco.MjSpec) -> None:
    """Add a motor on the left thigh that drives the knee by a gear."""
    shaft = spec.body("left_thigh").add_body(name="shaft", pos=[0.0, 0.02, -0.02])
    shaft.add_joint(name="motor", axis=[0, 1, 0], range=[-360, 360])
    shaft.add_geom(size=[0.005, 0, 0], mass=0.002)
    spec.add_actuator(
        target="motor", trntype=mujoco.mjtTrn.mjTRN_JOINT, forcerange=[-TORQUE, TORQUE]
    )
    spec.add_actuator(
        target="right_shank_joint",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        forcerange=[-GEAR * TORQUE, GEAR * TORQUE],
    )


def tie(spec: mujoco.MjSpec, joint: str, leader: str, ratio: float) -> None:
    """Let a joint turn so much for each turn of another one."""
    data = [0.0, ratio, *[0.0] * 10]
    spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=joint, name2=leader, data=data)


def add_gear(spec: mujoco.MjSpec, ratio: float = 1.0 / GEAR) -> None:
    add_motor(spec)
    tie(spec, "left_shank_joint", "motor", ratio)


def add_rod(spec: mujoco.MjSpec) -> None:
    add_motor(spec)
    rod = spec.body("shaft").add_body(name="rod", pos=[0.0, 0.0, -0.12])
    rod.add_joint(name="rod_joint", axis=[0, 1, 0], range=[-360, 360])
    rod.add_geom(size=[0.005, 0, 0], mass=0.001)
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1="rod",
        name2="left_shank",
    )


def imported(tmp_path: Path, change: Callable[[mujoco.MjSpec], None]) -> ImportedRobot:
    (tmp_path / "model.xml").write_text(small_humanoid(change=change))
    return import_model(tmp_path / "model.xml", ImportOptions(name="small"))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_geared_knee_has_the_motors_servo_and_its_gear(tmp_path: Path, sign: int):
    """What is written is loaded; a gear that reverses turns the servo's sign."""
    robot = imported(tmp_path, lambda spec: add_gear(spec, sign / GEAR))
    assert "motor" not in robot.joints
    (fold,) = robot.folds
    assert (fold.motors, fold.joints) == (("motor",), ("left_shank_joint",))
    assert abs(fold.gear) == pytest.approx(GEAR)
    servo = servo_models()[robot.servos.types[robot.joints.index("left_shank_joint")]]
    stall = servo.stall_torque * robot.servos.supply / servo.nominal_voltage
    assert stall == pytest.approx(TORQUE, rel=0.25)
    assert any("left_shank_joint driven by motor through gears" in g for g in robot.guesses)
    write_robot(robot, tmp_path / "small")
    loaded = load_robot(tmp_path / "small")
    assert loaded.joint_names == robot.joints
    assert loaded.standing.joint_pos == pytest.approx(robot.stance.joint_pos, abs=1e-4)
    assert tuple(loaded.mirror_index) == robot.mirror
    assert tuple(joint.segment for joint in loaded.joints) == robot.segments
    servo = loaded.joints[loaded.joint_names.index("left_shank_joint")].servo
    assert (servo.sign, servo.gear) == (sign, pytest.approx(GEAR))


def test_a_loop_and_a_tie_beside_a_gear_are_reported(tmp_path: Path):
    notes = imported(tmp_path, add_rod).notes
    assert any("closed loop that joins rod and left_shank is open" in note for note in notes)

    def change(spec: mujoco.MjSpec) -> None:
        add_gear(spec)
        tie(spec, "right_forearm_joint", "right_upper_arm_joint", 1.0)

    robot = imported(tmp_path, change)
    assert [each.joints for each in robot.folds] == [("left_shank_joint",)]
    (note,) = [note for note in robot.notes if "are coupled in the model" in note]
    assert "right_forearm_joint" in note and "right_upper_arm_joint" in note


def test_what_follows_a_motors_shaft_is_separate(tmp_path: Path):
    def follow_shaft(spec: mujoco.MjSpec) -> None:
        add_motor(spec)
        tie(spec, "left_shank_joint", "motor", 1.0 / GEAR)
        tie(spec, "left_foot_joint", "motor", 0.2)

    robot = imported(tmp_path, follow_shaft)
    assert robot.passive_joints == ()
    assert robot.spec.compile().neq == 0


def test_joints_that_mimic_others_follow_them_without_servo(tmp_path: Path):
    """The forearms follow the upper arms, as those of parallelograms do."""
    text = small_urdf()
    for side in ("left", "right"):
        old = f'<child link="{side}_forearm"/>'
        mimic = f'{old}<mimic joint="{side}_upper_arm_joint" multiplier="-0.5"/>'
        text = spoiled(text, old, mimic)
    (tmp_path / "model.urdf").write_text(text)
    found = import_model(tmp_path / "model.urdf", ImportOptions(name="small"))
    assert found.passive_joints == ("left_forearm_joint", "right_forearm_joint")
    assert not {*found.passive_joints} & {*found.joints}
    note = "left_forearm_joint follows left_upper_arm_joint (-0.5 turns to one) and has no servo"
    assert any(note in each for each in found.notes)
    write_robot(found, tmp_path / "small")
    robot = load_robot(tmp_path / "small")
    assert robot.passive_joints == found.passive_joints
    view = JointView.of(robot)
    angles = robot.standing.joint_pos.copy()
    angles[robot.joint_names.index("left_upper_arm_joint")] += 0.4
    view.look(angles)
    moved = view.data.joint("left_forearm_joint").qpos[0]
    assert moved == pytest.approx(-0.5 * angles[robot.joint_names.index("left_upper_arm_joint")])
