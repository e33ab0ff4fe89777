"""Models that are not humanoids, or are broken: one clear line each, and nothing half-made."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from small_humanoid import small_humanoid, small_urdf

from robots import load_robot
from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.model_import.source import ModelImportError


def problems_of(path: Path, content: str | bytes, **options) -> tuple[str, ...]:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(ModelImportError) as caught:
        import_model(path, ImportOptions(name="small", **options))
    assert all("\n" not in problem for problem in caught.value.problems)
    return caught.value.problems


def change_joint(name: str, kind: mujoco.mjtJoint) -> Callable[[mujoco.MjSpec], object]:
    def change(spec: mujoco.MjSpec) -> None:
        spec.joint(name).type = kind

    return change


def cut(*bodies: str) -> Callable[[mujoco.MjSpec], object]:
    def change(spec: mujoco.MjSpec) -> None:
        for body in bodies:
            spec.delete(spec.body(body))

    return change


def hang(spec: mujoco.MjSpec) -> None:
    torso = spec.body("torso")
    spec.delete(torso.joints[0])
    torso.add_joint(name="string", type=mujoco.mjtJoint.mjJNT_HINGE)


def point_feet(spec: mujoco.MjSpec) -> None:
    for side in ("left", "right"):
        foot = spec.body(f"{side}_foot").geoms[0]
        foot.type, foot.size = mujoco.mjtGeom.mjGEOM_SPHERE, [0.01, 0, 0]
        foot.pos = [0, 0, -0.03]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (cut("right_hip_yaw"), "expected two legs of at least 3 hinges"),
        (cut("left_hip_yaw", "right_hip_yaw"), "expected two legs"),
        (cut("left_thigh", "right_thigh"), "expected two legs"),
        (change_joint("left_shank_joint", mujoco.mjtJoint.mjJNT_BALL), "is a ball joint"),
        (change_joint("left_shank_joint", mujoco.mjtJoint.mjJNT_SLIDE), "is a slide joint"),
        (hang, "hangs on the world by hinge 'string', expected a free joint or none"),
        (point_feet, "no flat face that looks down, expected a sole"),
    ],
)
def test_a_model_that_is_not_a_humanoid_is_refused(tmp_path: Path, change, told: str):
    (problem,) = problems_of(tmp_path / "model.xml", small_humanoid(change=change))
    assert told in problem


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "not XML"),
        (b"\xff\x00", "not XML"),
        (b"<mujoco", "not XML"),
        (b"<sdf/>", "its root is <sdf>, expected <mujoco> (MJCF) or <robot> (URDF)"),
        (b"<mujoco/>", "it has no hinges"),
        (b"<mujoco><worldbody><body><geom/></body></worldbody></mujoco>", "model.xml: "),
        (small_urdf(scale=1000.0), "lengths are in m"),
        (small_urdf(angle=1.0), "rad, expected at most 12.6 rad: limits of a URDF are in rad"),
        (small_urdf(mesh="package://small/torso.stl"), "of link 'torso' is not found"),
        (small_urdf(mesh="torso.step"), "is of kind '.step', expected .stl, .obj, .msh, .dae"),
        (small_urdf(mesh="noise.stl"), "cannot be read (it holds no solid)"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, content: str | bytes, told: str):
    (tmp_path / "torso.step").write_text("a solid")
    (tmp_path / "noise.stl").write_text("no numbers here")
    assert told in "\n".join(problems_of(tmp_path / "model.xml", content))


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"servos": ("XM999",)}, "--servo is 'XM999': unknown type 'XM999'"),
        ({"servos": ("XM430-W350=*tail*",)}, "no joint matches '*tail*'"),
        ({"fixed": ("left_tail",)}, "--fix is 'left_tail', expected one of left_hip_yaw_joint"),
    ],
)
def test_what_was_said_must_fit_the_model(tmp_path: Path, options, told: str):
    (problem,) = problems_of(tmp_path / "model.xml", small_humanoid(), **options)
    assert told in problem


def test_a_torso_fixed_to_the_world_floats(tmp_path: Path):
    (tmp_path / "model.urdf").write_text(small_urdf())
    robot = import_model(tmp_path / "model.urdf", ImportOptions(name="small"))
    assert any("floats now" in note for note in robot.notes)
    assert robot.spec.compile().jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert set(robot.servos.types) == {"XM430-W350"}  # 4.1 N·m at 12 V, as its URDF says


def test_ranges_that_contradict_their_mirror_images_are_told(tmp_path: Path):
    def turn(spec: mujoco.MjSpec) -> None:
        spec.joint("left_shank_joint").range = np.radians([-140.0, 0.0]) * 180.0 / np.pi

    (tmp_path / "model.xml").write_text(small_humanoid(change=turn))
    robot = import_model(tmp_path / "model.xml", ImportOptions(name="small"))
    (note,) = [note for note in robot.notes if "mirror" in note]
    assert "left_shank_joint and right_shank_joint" in note
    assert "-140 to 0 deg and 0 to 140 deg" in note


def test_a_folder_is_complete_or_not_there(tmp_path: Path):
    (tmp_path / "model.xml").write_text(small_humanoid())
    robot = import_model(tmp_path / "model.xml", ImportOptions(name="small"))
    broken = replace(robot, segments=robot.segments[:-1])  # a mistake while it is written
    with pytest.raises(IndexError):
        write_robot(broken, tmp_path / "robots" / "small")
    assert not list((tmp_path / "robots").iterdir())
    write_robot(robot, tmp_path / "robots" / "small")
    assert load_robot(tmp_path / "robots" / "small").joint_names == robot.joints
    with pytest.raises(ModelImportError, match="is not empty, expected a new folder"):
        write_robot(robot, tmp_path / "robots" / "small")
