"""What of an unknown model is the robot: its hinges, legs, arms, head, and where its front is."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from small_humanoid import small_humanoid

from robots.model_import.anatomy import Anatomy, find_anatomy
from robots.model_import.source import ModelImportError, ModelSource
from robots.model_import.tree import KinematicTree, find_tree

PATH = Path("small.xml")


def find(notes: list[str] | None = None, **how) -> Anatomy:
    model = mujoco.MjModel.from_xml_string(small_humanoid(**how))
    notes = [] if notes is None else notes
    return find_anatomy(
        find_tree(ModelSource(path=PATH, model=model, actuators={}), notes), PATH, notes
    )


def names(anatomy: Anatomy, hinges: tuple[int, ...]) -> list[str]:
    return [anatomy.tree.hinges[k].name.removesuffix("_joint") for k in hinges]


def hide_sides(name: str) -> str:
    return name.replace("left", "part").replace("right", "piece")


def test_limbs_are_found_by_where_they_are():
    anatomy = find()
    leg = ["hip_yaw", "hip_roll", "thigh", "shank", "ankle", "foot"]
    assert names(anatomy, anatomy.legs[0]) == [f"left_{part}" for part in leg]
    assert names(anatomy, anatomy.legs[1]) == [f"right_{part}" for part in leg]
    ((left, right),) = anatomy.arms
    assert names(anatomy, left) == ["left_shoulder", "left_upper_arm", "left_forearm"]
    assert names(anatomy, right) == ["right_shoulder", "right_upper_arm", "right_forearm"]
    assert names(anatomy, anatomy.head) == ["head"]


@pytest.mark.parametrize("yaw", [0.0, 1.0, np.pi])
def test_feet_tell_the_front_without_names(yaw: float):
    anatomy = find(rename=hide_sides, yaw=yaw)
    assert anatomy.axes[:, 0] == pytest.approx([np.cos(yaw), np.sin(yaw), 0.0], abs=1e-6)
    assert names(anatomy, anatomy.legs[0])[0] == "part_hip_yaw"


def shorten_feet(spec: mujoco.MjSpec) -> None:
    for side in ("part", "piece"):
        spec.body(f"{side}_foot").geoms[0].pos[0] = 0.0


def test_knees_tell_the_front_where_feet_do_not():
    notes: list[str] = []
    anatomy = find(notes, rename=hide_sides, change=shorten_feet)
    assert anatomy.axes == pytest.approx(np.eye(3))
    assert notes == []


def swap_sides(name: str) -> str:
    side, _, part = name.partition("_")
    swap = {"left": "right", "right": "left"}
    return f"{swap[side]}_{part}" if side in swap else name


def reverse_knees(spec: mujoco.MjSpec) -> None:
    for joint in spec.joints:
        if "shank" in joint.name:
            joint.range = -joint.range[::-1]


def open_knees(spec: mujoco.MjSpec) -> None:
    for joint in spec.joints:
        if "shank" in joint.name:
            joint.range = [-90.0, 90.0]


def reverse_feet(spec: mujoco.MjSpec) -> None:
    for body in spec.bodies:
        if "foot" in body.name:
            body.geoms[0].pos[0] *= -1.0


@pytest.mark.parametrize(
    ("rename", "change", "words"),
    [
        (str, None, None),
        (swap_sides, None, "feet and knees point backwards, going by left and right"),
        (str, reverse_knees, "the knees bend backwards: correct their ranges or axes"),
        (hide_sides, reverse_knees, "the knees bend backwards: correct their ranges or axes"),
        (swap_sides, open_knees, "the feet are longer behind the ankles, going by left"),
        # Bez2 has such feet: names and knees agree.
        (str, reverse_feet, None),
    ],
)
def test_what_stands_against_the_names_is_said(rename, change, words: str | None):
    notes: list[str] = []
    anatomy = find(notes, rename=rename, change=change or (lambda _: None))
    assert anatomy.axes[0, 0] == pytest.approx(-1.0 if rename is swap_sides else 1.0)
    assert [note[: len(words)] for note in notes] == [words] if words else notes == []


def add_ends(spec: mujoco.MjSpec) -> None:
    """Put a tail on the torso, and a mouth on the head."""
    tail = spec.body("torso").add_body(name="tail", pos=[-0.05, 0.0, 0.0])
    tail.add_joint(name="tail_joint", axis=[0, 1, 0], range=[-50, 50])
    tail.add_geom(size=[0.01, 0, 0], mass=0.01)
    mouth = spec.body("head").add_body(name="mouth", pos=[0.04, 0.0, 0.02])
    mouth.add_joint(name="mouth_joint", axis=[0, 1, 0], range=[-20, 20])
    mouth.add_geom(size=[0.01, 0, 0], mass=0.01)


def test_a_tail_is_no_head_and_a_mouth_belongs_to_it():
    anatomy = find(change=add_ends)
    assert names(anatomy, anatomy.head) == ["head", "mouth"]
    assert len(anatomy.arms) == 1


BODY = '<geom size="0.05" mass="0.5"/>'
ROBOT = f"""<body name="torso" pos="0 0 0.5">JOINT{BODY}
  <body name="arm" pos="0 0.1 0.1"><joint name="lift" axis="1 0 0"/><joint axis="0 1 0"/>{BODY}
    <body name="glove" pos="0 0 -0.1">{BODY}
      <body name="finger" pos="0 0 -0.1"><joint name="grip" axis="0 0 1"/>{BODY}</body>
  </body></body>
  <body name="leg" pos="0 0 -0.3"><joint name="hip" axis="0 1 0"/>{BODY}</body></body>"""
SCENE = '<body name="door"><joint name="door" axis="0 0 1"/><geom size="0.1"/></body>'


def find_parts(
    body: str = ROBOT, joint: str = "<freejoint/>", **stance: float
) -> tuple[KinematicTree, list[str]]:
    text = f"<mujoco><worldbody>{SCENE}{body.replace('JOINT', joint)}</worldbody></mujoco>"
    model, notes = mujoco.MjModel.from_xml_string(text), []
    source = ModelSource(path=Path("own.xml"), model=model, actuators={}, stance=stance)
    return find_tree(source, notes), notes


def test_hinges_are_where_they_are_in_the_stance_of_what_is_the_robot():
    """By hand: the arm is lifted by a right angle to the left, the finger 20 cm out.

    A frame that only holds the robot is no part of it.
    """
    tree, _ = find_parts(lift=np.pi / 2.0)
    assert tree.hinges[2].anchor == pytest.approx([0.0, 0.3, 0.6])
    assert tree.hinges[2].axis == pytest.approx([0.0, -1.0, 0.0], abs=1e-9)
    tree, _ = find_parts(f'<body name="frame" pos="0 0 1">{ROBOT}</body>'.replace("JOINT", ""))
    assert tree.model.body(tree.root).name == "torso"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('size="0.05"', 'size="200"', "of body 'torso' reaches 200 m .* a mesh in mm needs scale"),
        ('mass="0.5"', 'mass="500"', "expected 0.1 to 500 kg: masses are in kg"),
    ],
)
def test_what_no_servo_humanoid_has_is_named(old: str, new: str, message: str):
    with pytest.raises(ModelImportError, match=message):
        find_parts(ROBOT.replace(old, new))
