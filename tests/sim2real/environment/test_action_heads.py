"""Ankles turn a torso that is off its curves back, and only near the stance."""

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")

from humanoid_getup.simulation.world import World
from humanoid_getup.style.features import mirror_features, torso_angles
from robots import Robot, quaternion
from robots.kinematics import place
from sim2real.environment.action_heads import BEGIN, LARGEST, AnkleBalance

RIGHT = np.pi / 2
STANCE = np.array([[1.0, RIGHT, RIGHT]])


@pytest.fixture
def balance(op3: Robot) -> AnkleBalance:
    return AnkleBalance(op3)


@pytest.mark.parametrize("lean", [[0.2, 0.0], [-0.2, 0.0], [0.0, 0.2], [0.0, -0.2]])
def test_with_the_feet_held_the_correction_lessens_the_lean(op3: Robot, world: World, lean):
    """The torso's angles, as the ankles turn it over feet that stay, by forward kinematics."""
    model = world.model
    data, layout = mujoco.MjData(model), op3.layout(model)
    correction = AnkleBalance(op3).correct(STANCE, STANCE + np.array([0.0, *lean]))[0]
    soles, angles = [], []
    for joint_pos in (op3.standing.joint_pos, op3.standing.joint_pos + correction):
        data.qpos[:] = place(op3, model, op3.standing)
        data.qpos[layout.qpos] = joint_pos
        mujoco.mj_kinematics(model, data)
        soles.append(data.site(op3.sole_sites[0]).xmat.reshape(3, 3).copy())
        angles.append(torso_angles(quaternion.gravity_in_body(op3.standing.orientation)))
    # Gravity as the torso sees it once the foot is back as it was.
    turned = soles[0] @ soles[1].T
    down = turned.T @ np.array([0.0, 0.0, -1.0])
    conjugate = op3.standing.orientation * [1.0, -1.0, -1.0, -1.0]
    moved = torso_angles(quaternion.rotate(conjugate, down)) - angles[0]
    assert np.sign(moved[np.argmax(np.abs(lean))]) == -np.sign(sum(lean))
    assert np.abs(correction).max() <= LARGEST


def test_a_robot_that_is_low_or_as_it_should_be_is_left_alone(balance):
    low = np.array([[BEGIN - 0.01, RIGHT + 0.3, RIGHT - 0.3]])
    assert not balance.correct(STANCE, low).any()
    assert not balance.correct(STANCE, STANCE).any()


def test_mirrored_leans_have_mirrored_corrections(op3: Robot, balance):
    leaning = STANCE + np.array([0.0, 0.1, -0.2])
    mirrored = balance.correct(mirror_features(STANCE), mirror_features(leaning))
    assert mirrored[0] == pytest.approx(op3.mirror_joints(balance.correct(STANCE, leaning)[0]))
