"""Models that are not humanoids, or are broken: one clear line each, and nothing half-made."""

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from nonempty import nonempty
from small_humanoid import small_humanoid, small_urdf

from robots import load_robot
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.model_import.source import ModelImportError


def imported(path: Path, content: str) -> ImportedRobot:
    path.write_text(content)
    return import_model(path, ImportOptions(name="small"))


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


BALL, SLIDE = mujoco.mjtJoint.mjJNT_BALL, mujoco.mjtJoint.mjJNT_SLIDE
NO_HUMANOIDS = [
    (cut("right_hip_yaw"), "expected two legs of at least 3 hinges"),
    (change_joint("left_shank_joint", BALL), "is a ball joint"),
    (change_joint("left_shank_joint", SLIDE), "is a slide joint"),
    (hang, "hangs on the world by hinge 'string', expected a free joint or none"),
    (point_feet, "no flat face that looks down, expected a sole"),
]
WRONG_TEXTS = [
    ("left_hip_yaw_joint", "left&#10;hip", r"joint 'left\nhip' is named so"),
    ("left_hip_yaw_joint", " ", "joint ' ' is named so, expected printable characters"),
    ("left_forearm", "left&#x2028;forearm", r"body 'left\u2028forearm' is named so"),
    ('mass="1"', 'mass="nan"', "<geom> has mass 'nan', expected finite numbers"),
    ('pos="0 0 0.12"', 'pos="0 inf 0.12"', "has a pos of"),
    ('mass="1"', 'mass="-1"', "mass"),
    ("<worldbody>", "<worldbody><replicate count='1000000000'><site/></replicate>", "copies"),
]
"""What no robot folder can hold."""
WRONG_RANGES = [
    ("2.4 0", "joint 'head_joint' has limits from 2.4 to 0 rad, expected the lower one first"),
    ("0 20", "joint 'head_joint' has a limit of 20 rad, expected at most 12.6 rad: it is in d"),
]
WRONG_FILES = [
    (b"<?xml version='1.0' encoding='nonsense'?><robot/>", "unknown encoding: nonsense"),
    (b"<sdf/>", "its root is <sdf>, expected <mujoco> (MJCF) or <robot> (URDF)"),
    (b"<mujoco/>", "it has no hinges"),
    (b"<mujoco><worldbody><body><geom/></body></worldbody></mujoco>", "model.xml: "),
    (small_urdf(scale=1000.0), "expected 0.1 to 3 m: lengths are in m, these look like mm"),
    (small_urdf(angle=1.0), "rad, expected at most 12.6 rad: limits of a URDF are in rad"),
    (small_urdf(mesh="package://small/torso.stl"), "of link 'torso' is not found"),
    (small_urdf(mesh="torso.step"), "is of kind '.step', expected .stl, .obj, .msh, .dae"),
    (small_urdf(mesh="noise.stl"), "cannot be read (it holds no solid)"),
]
WRONG_WORDS = [
    ({"servos": ("XM999",)}, "--servo is 'XM999': unknown type 'XM999'"),
    ({"servos": ("XM430-W350=*tail*",)}, "no joint matches '*tail*'"),
    ({"fixed": ("left_tail",)}, "--fix is 'left_tail', expected one of left_hip_yaw_joint"),
]


def test_a_model_that_is_no_humanoid_or_broken_is_refused(tmp_path: Path):
    (tmp_path / "torso.step").write_text("a solid")
    (tmp_path / "noise.stl").write_text("no numbers here")
    text, limits = small_humanoid(), re.compile(r'(name="head_joint" range=")[^"]*')
    assert all(before in text for before, _, _ in WRONG_TEXTS)
    models: list[tuple[str | bytes, str]] = [
        *((small_humanoid(change=change), message) for change, message in NO_HUMANOIDS),
        *((text.replace(before, after), message) for before, after, message in WRONG_TEXTS),
        *((limits.sub(rf"\g<1>{ends}", text), message) for ends, message in WRONG_RANGES),
        *WRONG_FILES,
    ]
    for content, message in nonempty(models):
        assert message in "\n".join(problems_of(tmp_path / "model.xml", content))
    for options, message in nonempty(WRONG_WORDS):
        (problem,) = problems_of(tmp_path / "model.xml", text, **options)
        assert message in problem


def test_a_mesh_that_is_a_fifo_is_refused_at_once(tmp_path: Path):
    os.mkfifo(tmp_path / "TORSO.STL")
    (problem,) = problems_of(tmp_path / "model.urdf", small_urdf(mesh="torso.stl"))
    assert "cannot be read (it is a FIFO, expected a file)" in problem


def test_the_root_of_a_urdf_floats(tmp_path: Path):
    robot = imported(tmp_path / "model.urdf", small_urdf())
    assert not robot.notes  # the root of a URDF is not fixed: no joint is said of it
    assert robot.spec.compile().jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert set(robot.servos.types) == {"XM430-W350"}  # 4.1 N·m at 12 V, as its URDF says


@pytest.mark.parametrize(
    ("turn", "count", "said"), [("HINGE", 3, "three hinges"), ("BALL", 1, "ball")]
)
def test_a_root_of_three_slides_that_turns_freely_floats(
    tmp_path: Path, turn: str, count: int, said: str
):
    turning = getattr(mujoco.mjtJoint, f"mjJNT_{turn}")
    kinds = {"slide": (mujoco.mjtJoint.mjJNT_SLIDE, 3), "turn": (turning, count)}

    def hold(spec: mujoco.MjSpec) -> None:
        torso = spec.body("torso")
        spec.delete(torso.joints[0])
        for name, (kind, number) in kinds.items():
            for axis, letter in zip(np.eye(3)[:number], "xyz"[:number], strict=True):
                torso.add_joint(name=f"{name}_{letter}", type=kind, axis=axis.tolist())

    robot = imported(tmp_path / "model.xml", small_humanoid(change=hold))
    assert f"three slides and {said} are replaced by a free joint" in robot.notes[0]
    assert len(robot.joints) == 19
    assert not [name for name in robot.joints if name.startswith(tuple(kinds))]


def test_ranges_that_cannot_be_are_reported(tmp_path: Path):
    """Of two equal ends, and those that contradict their mirror images."""
    text = re.sub(r'(name="head_joint" range=")[^"]*', r"\g<1>0.5 0.5", small_humanoid())
    robot = imported(tmp_path / "model.xml", text)
    assert "-180 to 180 deg for joints without range, or of equal ends: head_joint" in robot.notes

    def turn(spec: mujoco.MjSpec) -> None:
        spec.joint("left_shank_joint").range = [-140.0, 0.0]

    robot = imported(tmp_path / "model.xml", small_humanoid(change=turn))
    (note,) = [note for note in robot.notes if "mirror" in note]
    assert "left_shank_joint and right_shank_joint" in note
    assert "-140 to 0 deg and 0 to 140 deg" in note


def test_a_folder_is_complete_or_not_there(tmp_path: Path):
    robot = imported(tmp_path / "model.xml", small_humanoid())
    broken = replace(robot, segments=robot.segments[:-1])  # a mistake while it is written
    with pytest.raises(IndexError):
        write_robot(broken, tmp_path / "robots" / "small")
    assert not list((tmp_path / "robots").iterdir())
    write_robot(robot, tmp_path / "robots" / "small")
    assert load_robot(tmp_path / "robots" / "small").joint_names == robot.joints
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "empty")
    with pytest.raises(ModelImportError, match="is a symbolic link, expected a new folder"):
        write_robot(robot, tmp_path / "link")
    with pytest.raises(ModelImportError, match="is not empty, expected a new folder"):
        write_robot(robot, tmp_path / "robots" / "small")
