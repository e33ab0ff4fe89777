"""The tree of a model: which part of it is the robot, and where its hinges are."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model_import.source import ModelImportError, ModelSource
from robots.model_import.tree import KinematicTree, find_tree

BODY = '<geom size="0.05" mass="0.5"/>'
ROBOT = f"""<body name="torso" pos="0 0 0.5">JOINT{BODY}
  <body name="arm" pos="0 0.1 0.1"><joint name="lift" axis="1 0 0"/><joint axis="0 1 0"/>{BODY}
    <body name="glove" pos="0 0 -0.1">{BODY}
      <body name="finger" pos="0 0 -0.1"><joint name="grip" axis="0 0 1"/>{BODY}</body>
  </body></body>
  <body name="leg" pos="0 0 -0.3"><joint name="hip" axis="0 1 0"/>{BODY}</body></body>"""
SCENE = '<body name="door"><joint name="door" axis="0 0 1"/><geom size="0.1"/></body>'


def find(
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
    tree, _ = find(lift=np.pi / 2.0)
    assert tree.hinges[2].anchor == pytest.approx([0.0, 0.3, 0.6])
    assert tree.hinges[2].axis == pytest.approx([0.0, -1.0, 0.0], abs=1e-9)
    tree, _ = find(f'<body name="frame" pos="0 0 1">{ROBOT}</body>'.replace("JOINT", ""))
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
        find(ROBOT.replace(old, new))
