"""Loads: what a robot holds weighs where it is said to be, and nothing else changes."""

import pickle

import mujoco
import numpy as np
import pytest

from robots import Body, Robot, load_robot
from robots.description.loading import hold
from robots.individual import Individual
from robots.kinematics import place

KG = 0.2


def settle(robot: Robot, joint_pos: np.ndarray) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Put a robot's joints to angles, its torso upright."""
    model = robot.spec().compile()
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    data.qpos[robot.layout(model).root_orientation] = [1.0, 0.0, 0.0, 0.0]
    data.qpos[robot.layout(model).qpos] = joint_pos
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("name", ["op3", "human", "wolfgang", "toddlerbot"])
@pytest.mark.parametrize("hand", ["left_hand", "right_hand"])
def test_mass_grows_by_the_load_and_its_center_moves_towards_the_hand(name: str, hand: str):
    robot = load_robot(name)
    loaded = load_robot(name, load={hand: KG})
    _, before = settle(robot, robot.standing.joint_pos)
    model, after = settle(loaded, robot.standing.joint_pos)
    total, com = model.body_subtreemass[0], before.subtree_com[0]
    place_of_load = after.body(f"load_{hand}").xpos
    assert total == pytest.approx(before.model.body_subtreemass[0] + KG)
    moved = KG / total * (place_of_load - com)
    assert after.subtree_com[0] - com == pytest.approx(moved, abs=1e-9)
    assert moved[1] * (1.0 if hand == "left_hand" else -1.0) > 0.0
    assert model.ngeom == before.model.ngeom


def test_a_load_in_the_hand_of_a_stretched_arm_weighs_on_the_shoulder(op3: Robot):
    held = hold(op3, {"l_hand": KG})
    (model, without), (_, with_it) = (settle(robot, np.zeros(op3.n)) for robot in (op3, held))
    dof = model.joint("l_sho_roll").dofadr[0]
    # At zero the arms point sideways: 0.0904 m to the elbow, and 0.1465 m to the hand.
    by_hand = 0.2 * 9.81 * (0.0904 + 0.1465)
    grown = with_it.qfrc_bias[dof] - without.qfrc_bias[dof]
    assert abs(grown) == pytest.approx(by_hand, rel=1e-6)


def test_a_load_is_at_a_site_in_the_middle_of_a_body_or_at_the_end_of_an_arm(op3: Robot):
    places = {name: hold(op3, {name: KG}).held[0] for name in ("l_hand", "l_el_link", "left_hand")}
    assert {each.body for each in places.values()} == {"l_el_link"}
    # Of the forearm, a capsule from 0 to 0.128 m with a radius of 0.018 m.
    expected = {"l_hand": 0.1465, "l_el_link": 0.064, "left_hand": 0.146}
    for name, y in expected.items():
        assert places[name].position == pytest.approx([-0.019, y, 0.0], abs=0.004), name


def test_a_longer_arm_holds_it_farther_away(op3: Robot):
    long = load_robot("op3", Body(arms=1.6), load={"left_hand": KG})
    ratio = long.held[0].position[1] / hold(op3, {"left_hand": KG}).held[0].position[1]
    assert ratio == pytest.approx(1.6, rel=0.05)


def test_a_load_is_as_heavy_in_a_heavier_individual_and_in_another_process(op3: Robot):
    held = hold(op3, {"l_hand": KG, "r_hand": 0.1}).with_individual(Individual(mass=1.1))
    model = pickle.loads(pickle.dumps(held)).spec().compile()
    own = op3.spec().compile().body_subtreemass[0]
    assert model.body_subtreemass[0] == pytest.approx(1.1 * own + 0.3)
    assert held.load == "l_hand:0.2,r_hand:0.1"


def test_nothing_to_hold_takes_a_load_away(op3: Robot):
    empty = hold(hold(op3, {"l_hand": KG}), {})
    assert empty.spec().to_xml() == op3.spec().to_xml() and empty.load == ""


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ({"l_hand": 0.0}, r"load l_hand is 0 kg, expected above 0 and up to 3\.15 kg for op3"),
        ({"l_hand": float("nan")}, "load l_hand is nan kg"),
        ({"l_hand": 3.2}, "load l_hand is 3.2 kg"),
        ({"l_hand": "heavy"}, "load l_hand is 'heavy', expected a mass"),
        ({"tail": KG}, "on unknown 'tail', .* such as left_hand, right_hand, l_el_link, r_el_link"),
        ("l_hand:0.2", "load is 'l_hand:0.2', expected masses"),
    ],
)
def test_a_load_that_cannot_be_is_refused(op3: Robot, load: dict[str, float], message: str):
    with pytest.raises(ValueError, match=message):
        hold(op3, load)
