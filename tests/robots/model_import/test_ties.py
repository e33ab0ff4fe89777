"""Ties: the rows of a model's constraints, by hand, and their grouping."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model_import.importer import read_model
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


def test_a_gear_pair_becomes_one_joint_with_a_gear():
    (found,) = find(build(GEAR))
    assert (found.motors, found.joints, found.rods) == (("motor_1",), ("yaw",), ())
    assert found.gear == pytest.approx(-2.0)
    assert not found.is_loop


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
