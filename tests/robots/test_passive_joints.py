"""Robots with hinges that have no servo: a spring, and an output that gears drive."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiling import complaint, spoil

from drivers import Command, Twin
from robots import Posture, Robot, load_robot
from robots.body.joint_view import JointView
from robots.kinematics import mirror_positions, place, read_posture, rest_passive_joints

TOE = """<site name="l_sole" pos="0 0 -0.1"/>
        <body pos="0 0 -0.1">
          <joint name="l_toe" axis="0 1 0" stiffness="2" springref="10" damping="0.01"/>
          <geom type="sphere" size="0.01" mass="0.01"/>
        </body>"""
FIN = """<site name="r_sole" pos="0 0 -0.1"/>
        <body pos="0 0.1 0">
          <joint name="r_fin" axis="0 1 0" damping="0.01" armature="0.001"/>
          <geom type="sphere" size="0.01" mass="0.01"/>
        </body>"""
GEARS = """</worldbody>
  <equality><joint joint1="r_fin" joint2="r_hip" polycoef="0.1 -0.857 0.2 0 0"/></equality>"""


def follow(hip):
    return 0.1 - 0.857 * hip + 0.2 * hip**2


@pytest.fixture(scope="module")
def sprung(tmp_path_factory: pytest.TempPathFactory, tiny: Robot) -> Robot:
    """The tiny robot with a sprung toe, and a fin that gears drive from its hip."""
    folder = tmp_path_factory.mktemp("sprung")
    for file in ("robot.toml", "model.xml"):
        (folder / file).write_text((tiny.folder / file).read_text("utf-8"), "utf-8")
    spoil(folder, '<site name="l_sole" pos="0 0 -0.1"/>', TOE, "model.xml")
    spoil(folder, '<site name="r_sole" pos="0 0 -0.1"/>', FIN, "model.xml")
    spoil(folder, "</worldbody>", GEARS, "model.xml")
    spoil(folder, 'name = "tiny"', 'name = "sprung"\npassive_joints = ["l_toe", "r_fin"]')
    return load_robot(folder)


def chain(*joints: str) -> str:
    """Write bodies that hang from each other, each by a hinge with some attributes."""
    open_bodies = (
        f'<body pos="0 0 -0.1"><joint axis="0 1 0" {joint}/><geom size="0.01" contype="0"/>'
        for joint in joints
    )
    return "".join(open_bodies) + "</body>" * len(joints)


BODIES = chain(
    'name="first"',
    'name="second" ref="20"',
    'name="spring" stiffness="2" springref="10" ref="5"',
    'name="loose" springref="10" ref="-15"',  # without stiffness its reference means nothing
    'name="output" ref="30"',
    'name="bolted" ref="-5"',
    'name="next" ref="25"',
)
COUPLINGS = """
  <joint joint1="second" joint2="first"/>
  <joint joint1="spring" joint2="first" active="false"/>
  <joint joint1="output" joint2="second" polycoef="0.1 -0.857 0.2 0.1 -0.1"/>
  <joint joint1="next" joint2="output" polycoef="-0.2 0.5 0 0 0"/>
  <joint joint1="bolted" polycoef="0.3 0.5 0 0 0"/>"""


MODEL = mujoco.MjModel.from_xml_string(
    f"<mujoco><worldbody>{BODIES}</worldbody><equality>{COUPLINGS}</equality></mujoco>"
)


@given(angles=st.tuples(st.floats(-1.5, 1.0), st.floats(-1.5, 1.0)))
def test_each_of_several_passive_joints_rests_where_mujoco_moves_it_no_more(angles):
    data = mujoco.MjData(MODEL)
    data.qpos[:2] = angles
    rest_passive_joints(MODEL, ("bolted", "loose", "next", "output", "spring"), data.qpos)
    mujoco.mj_forward(MODEL, data)
    assert data.efc_pos[1:] == pytest.approx(0.0, abs=1e-9)  # the first holds no passive joint
    assert data.joint("spring").qfrc_passive == pytest.approx(0.0, abs=1e-12)
    assert data.joint("loose").qpos == pytest.approx(np.radians(-15.0))
    assert data.qpos[:2] == pytest.approx(angles)


@given(hips=st.tuples(st.floats(-1.5, 1.0), st.floats(-1.5, 1.0)).map(np.array))
def test_passive_joints_are_placed_where_they_rest(sprung: Robot, hips):
    model = sprung.spec().compile()
    posture = Posture(position=np.zeros(3), orientation=np.eye(4)[0], joint_pos=hips)
    qpos = place(sprung, model, posture)
    assert qpos[model.joint("l_toe").qposadr] == pytest.approx(np.radians(10.0))
    assert qpos[model.joint("r_fin").qposadr] == pytest.approx(follow(hips[1]))
    assert read_posture(sprung, model, qpos).joint_pos == pytest.approx(hips)
    view = JointView.of(sprung)
    view.look(hips)
    assert view.data.qpos[7:] == pytest.approx(qpos[7:]), "from the torso on"
    mirrored = mirror_positions(sprung, model, qpos)
    assert mirrored[model.joint("r_fin").qposadr] == pytest.approx(follow(hips[0]))
    # The independent judge: MuJoCo finds nothing to correct.
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    is_equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert np.abs(data.efc_pos[is_equality]) == pytest.approx(0.0, abs=1e-9)


def test_a_coupled_joint_follows_its_servo_on_the_twin(sprung: Robot):
    with Twin(sprung) as twin:
        for _ in range(60):
            twin.read()
            twin.write(Command.position(sprung, np.array([0.2, -0.3])))
        hip = float(twin.read().joint_pos[1])
        fin = twin.truth.data.joint("r_fin").qpos[0]
    assert hip == pytest.approx(-0.3, abs=0.05)
    assert fin == pytest.approx(follow(hip), abs=0.03)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ('"l_toe"', "one each, or its name in passive_joints if it has no servo"),
        ('"l_toe", "r_fin", "l_hip"', "passive_joints: 'l_hip' has a row in joints, expected none"),
        ('"l_toe", "r_fin", "tail"', "passive_joints: 'tail' is not in model.xml"),
        ('"l_toe", "r_fin", "root"', "passive_joints: 'root' is a free joint, expected a hinge"),
    ],
)
def test_a_wrong_passive_joint_is_reported(sprung: Robot, tmp_path: Path, names, words):
    for file in sprung.folder.iterdir():
        (tmp_path / file.name).write_text(file.read_text("utf-8"), "utf-8")
    spoil(tmp_path, '"l_toe", "r_fin"', names)
    assert words in complaint(tmp_path)
