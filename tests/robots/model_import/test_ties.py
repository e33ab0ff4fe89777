"""Gears and closed loops: a motor's hinge is welded, the output keeps its torque; ties by hand."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from small_humanoid import small_humanoid, small_urdf
from spoiling import spoiled

from robots import load_robot
from robots.body.joint_view import JointView
from robots.description.servo_catalog import servo_models
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model, read_model
from robots.model_import.robot_folder import write_robot
from robots.model_import.ties import find_folds, fold, list_ties

BASE = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base"><freejoint/>
      <geom type="box" size="0.1 0.1 0.1" mass="2"/>
      <body name="rotor_1"><joint name="motor_1" axis="0 0 1"/>
        <geom size="0.01" mass="0.002"/></body>
      <body name="rotor_2"><joint name="motor_2" axis="0 0 1"/>
        <geom size="0.01" mass="0.002"/></body>
      <body name="yoke"><joint name="yaw" axis="0 0 1" range="-1 1"/>
        <geom size="0.02" mass="0.1"/>
        <body name="arm"><joint name="roll" axis="1 0 0" range="-0.5 0.5"/>
          <geom size="0.03" mass="0.3"/></body></body>
    </body>
  </worldbody>
  TIES
  <actuator>
    <position joint="motor_1" kp="1" forcerange="-0.7 0.7"/>
    ACTUATOR
  </actuator>
  <sensor><jointpos joint="motor_1"/></sensor>
  <keyframe><key name="home" qpos="0 0 1 1 0 0 0 -0.2 0 0.1 0"/></keyframe>
</mujoco>"""
SECOND = '<position joint="motor_2" kp="1" forcerange="-0.5 0.5"/>'
GEAR = '<equality><joint joint1="yaw" joint2="motor_1" polycoef="0 -0.5 0 0 0"/></equality>'
DIFFERENTIAL = (
    "<tendon>"
    '<fixed limited="true" range="-0.01 0.01"><joint joint="yaw" coef="1"/>'
    '<joint joint="motor_1" coef="-0.25"/><joint joint="motor_2" coef="-0.25"/></fixed>'
    '<fixed limited="true" range="-0.01 0.01"><joint joint="roll" coef="1"/>'
    '<joint joint="motor_1" coef="0.5"/><joint joint="motor_2" coef="-0.5"/></fixed>'
    "</tendon>"
)
# A parallelogram: a crank of 30 mm turns a lever of 30 mm by a rod of 80 mm.
RODS = """<mujoco>
  <worldbody>
    <body name="base"><freejoint/>
      <geom type="box" size="0.1 0.1 0.1" mass="2"/>
      <body name="crank" pos="0 0 0.2"><joint name="motor" axis="0 -1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0.03 0 0" size="0.004" mass="0.003"/>
        <body name="rod" pos="0.03 0 0"><joint name="rod" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.08" size="0.003" mass="0.003"/>
          <site name="end" pos="0 0 -0.08"/><site name="end_y" pos="0 0.02 -0.08"/></body></body>
      <body name="shank" pos="0 0 0.12"><joint name="knee" axis="0 1 0" range="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.1" size="0.01" mass="0.3"/>
        <site name="lever" pos="LEVER 0 0"/><site name="lever_y" pos="LEVER 0.02 0"/></body>
    </body>
  </worldbody>
  <equality><connect site1="end" site2="lever"/><connect site1="end_y" site2="lever_y"/></equality>
  <actuator><position joint="motor" kp="1"/></actuator>
</mujoco>"""


def build(ties: str, actuator: str = "") -> str:
    return BASE.replace("TIES", ties).replace("ACTUATOR", actuator)


def find(text: str):
    model = mujoco.MjModel.from_xml_string(text)
    return find_folds(model, list_ties(model, model.qpos0))


def test_a_differential_becomes_a_coupling():
    (found,) = find(build(DIFFERENTIAL, SECOND))
    assert found.motors == ("motor_1", "motor_2")
    assert found.joints == ("yaw", "roll")
    # By hand: yaw = (m1 + m2) / 4 and roll = (m2 - m1) / 2.
    assert found.matrix == pytest.approx(np.array([[2.0, -1.0], [2.0, 1.0]]))


@pytest.mark.parametrize(("lever", "ratio"), [("0.03", -1.0), ("0.06", -2.0), ("0.015", -0.5)])
def test_rods_are_cut_and_their_ratio_is_measured(lever, ratio):
    model = mujoco.MjModel.from_xml_string(RODS.replace("LEVER", lever))
    (found,) = find_folds(model, list_ties(model, model.qpos0))
    assert (found.motors, found.joints, found.rods) == (("motor",), ("knee",), ("rod",))
    assert found.gear == pytest.approx(ratio)
    assert "through rods" in found.describe()


@pytest.mark.parametrize(
    "text",
    [
        build(""),  # nothing is tied
        build(GEAR.replace("motor_1", "motor_2")),  # to a hinge without actuator
        build(GEAR).replace('size="0.01" mass="0.002"', 'size="0.01" mass="0.5"'),  # a limb
        build(DIFFERENTIAL),  # one motor for two joints
        build(DIFFERENTIAL, SECOND).replace("-0.01 0.01", "-0.5 0.5"),  # a tendon that gives way
    ],
    ids=["free", "passive", "heavy", "short of a motor", "loose"],
)
def test_what_is_no_drive_stays_as_it_is(text):
    assert find(text) == []


def test_the_folded_model_keeps_driven_hinges_their_ranges_and_its_mass():
    text = build(DIFFERENTIAL, SECOND)
    spec = mujoco.MjSpec.from_string(text)
    before = spec.compile()
    fold(spec, find_folds(before, list_ties(before, before.qpos0)))
    after = spec.compile()
    names = [after.joint(k).name for k in range(after.njnt)][1:]
    assert names == ["yaw", "roll"]
    assert after.joint("roll").range.tolist() == [-0.5, 0.5]
    assert after.body_mass.sum() == pytest.approx(before.body_mass.sum())
    assert (after.neq, after.ntendon, after.nu, after.nkey) == (0, 0, 0, 0)


def test_the_torque_of_the_motor_and_the_pose_of_the_joint_are_kept(tmp_path: Path):
    file = tmp_path / "model.xml"
    file.write_text(build(GEAR), "utf-8")
    source = read_model(file)
    assert source.actuators["yaw"].effort == 0.7
    assert "motor_1" not in source.actuators
    assert source.stance["yaw"] == 0.1
    assert [each.joints for each in source.folds] == [("yaw",)]


TURNS = 2.5  # turns of the motor to one of the knee
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
        forcerange=[-TURNS * TORQUE, TURNS * TORQUE],
    )


def tie(spec: mujoco.MjSpec, joint: str, leader: str, ratio: float) -> None:
    """Let a joint turn so much for each turn of another one."""
    data = [0.0, ratio, *[0.0] * 10]
    spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=joint, name2=leader, data=data)


def add_gear(spec: mujoco.MjSpec, ratio: float = 1.0 / TURNS) -> None:
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
    robot = imported(tmp_path, lambda spec: add_gear(spec, sign / TURNS))
    assert "motor" not in robot.joints
    (fold,) = robot.folds
    assert (fold.motors, fold.joints) == (("motor",), ("left_shank_joint",))
    assert abs(fold.gear) == pytest.approx(TURNS)
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
    assert (servo.sign, servo.gear) == (sign, pytest.approx(TURNS))


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
