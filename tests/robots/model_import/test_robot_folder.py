"""The robot.toml of an imported robot: signs and gears of drives, matrices, servos of its own."""

import tomllib
from pathlib import Path

import mujoco
import pytest
from small_humanoid import small_humanoid

from robots import load_robot
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.model_import.robot_folder import describe_robot, write_robot

GEAR = 2.5  # turns of the motor to one of the knee


def import_geared(folder: Path, ratio: float) -> ImportedRobot:
    """Import a robot whose left knee turns so much for each turn of a motor."""

    def change(spec: mujoco.MjSpec) -> None:
        shaft = spec.body("left_thigh").add_body(name="shaft", pos=[0.0, 0.02, -0.02])
        shaft.add_joint(name="motor", axis=[0, 1, 0], range=[-360, 360])
        shaft.add_geom(size=[0.005, 0, 0], mass=0.002)
        spec.add_actuator(target="motor", trntype=mujoco.mjtTrn.mjTRN_JOINT, forcerange=[-1.6, 1.6])
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            name1="left_shank_joint",
            name2="motor",
            data=[0.0, ratio, *[0.0] * 10],
        )

    (folder / "model.xml").write_text(small_humanoid(change=change))
    return import_model(folder / "model.xml", ImportOptions(name="small"))


def read_row(robot: ImportedRobot, joint: str) -> dict:
    return next(
        row for row in tomllib.loads(describe_robot(robot))["joints"] if row["name"] == joint
    )


@pytest.mark.parametrize(("ratio", "sign"), [(1.0 / GEAR, 1), (-1.0 / GEAR, -1)])
def test_a_gear_that_reverses_turns_the_servos_sign(tmp_path: Path, ratio: float, sign: int):
    row = read_row(import_geared(tmp_path, ratio), "left_shank_joint")
    assert (row["sign"], row["gear"]) == (sign, pytest.approx(GEAR))


def test_what_is_written_is_what_is_loaded(tmp_path: Path):
    robot = import_geared(tmp_path, -1.0 / GEAR)
    write_robot(robot, tmp_path / "small")
    loaded = load_robot(tmp_path / "small")
    assert loaded.joint_names == robot.joints
    assert loaded.standing.joint_pos == pytest.approx(robot.stance.joint_pos, abs=1e-4)
    assert tuple(loaded.mirror_index) == robot.mirror
    assert tuple(joint.segment for joint in loaded.joints) == robot.segments
    servo = loaded.joints[loaded.joint_names.index("left_shank_joint")].servo
    assert (servo.sign, servo.gear) == (-1, pytest.approx(GEAR))
