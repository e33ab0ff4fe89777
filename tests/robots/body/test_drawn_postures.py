"""Props stand on soles and hands, their weight between them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from robots import Robot, load_robot, quaternion
from robots.body.drawn_postures import MOST_DOWN, Prop, draw_props
from robots.body.limbs import Limbs
from robots.body.statics import Statics
from robots.kinematics import place


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


@pytest.fixture(scope="module")
def props(limbs: Limbs) -> list[Prop]:
    return draw_props(limbs, 20, np.random.default_rng(0))


def test_props_have_soles_and_hands_on_the_ground_and_their_weight_between(
    op3: Robot, limbs: Limbs, props: list[Prop]
):
    statics = Statics(op3)
    model = op3.spec().compile()
    data, length = mujoco.MjData(model), limbs.thigh_and_shank
    assert len(props) > 5
    for prop in props:
        posture = statics.make_posture(prop.joint_pos)
        data.qpos[:] = place(op3, model, posture)
        mujoco.mj_forward(model, data)
        hands = [
            data.xpos[body] + data.xmat[body].reshape(3, 3) @ place for body, place in prop.hands
        ]
        soles = np.array([data.site(name).xpos for name in op3.sole_sites])
        forward = data.site_xmat[model.site(op3.sole_sites[0]).id].reshape(3, 3)[:, 0]
        assert np.array([hand[2] for hand in hands]) == pytest.approx(0.0, abs=0.05 * length)
        assert soles[:, 2] == pytest.approx(0.0, abs=0.05 * length)
        between = soles.mean(axis=0) + prop.share * (np.mean(hands, axis=0) - soles.mean(axis=0))
        off = (data.subtree_com[limbs.torso] - between) @ forward
        assert off == pytest.approx(0.0, abs=0.05 * length)
        assert np.cos(quaternion.tilt(posture.orientation)) > -MOST_DOWN
        assert np.array_equal(op3.symmetrize(prop.joint_pos), prop.joint_pos)


def test_a_trunk_bends_for_a_prop():
    """The human's hands reach the ground in few postures without its waist and chest."""
    human = load_robot("human")
    names = ("waist_pitch", "spine_pitch", "chest_pitch")
    bends = [human.joint_names.index(name) for name in names]
    props = draw_props(Limbs(human), 10, np.random.default_rng(0))
    home = human.standing.joint_pos[bends]
    assert len(props) > 2
    assert all(np.abs(prop.joint_pos[bends] - home).max() > 0.05 for prop in props)


def test_a_prop_that_one_side_cannot_take_is_left_out(op3: Robot, props: list[Prop]):
    upper, elbow = op3.upper.copy(), op3.joint_names.index("r_el")
    upper[elbow] = np.median([prop.joint_pos[elbow] for prop in props])
    joints = [replace(j, upper=float(u)) for j, u in zip(op3.joints, upper, strict=True)]
    one = draw_props(Limbs(replace(op3, joints=tuple(joints))), 20, np.random.default_rng(0))
    assert 0 < len(one) < len(props)
    assert all(prop.joint_pos[elbow] <= upper[elbow] for prop in one)


def test_targets_of_a_prop_ask_less_of_the_legs_the_more_the_hands_carry(
    op3: Robot, props: list[Prop]
):
    prop = max(props, key=lambda each: each.share)
    statics, legs = Statics(op3), [k for k, name in enumerate(op3.joint_names) if "knee" in name]
    lead = {
        share: np.abs(statics.find_targets(prop.joint_pos, prop.hands, share) - prop.joint_pos)
        for share in (0.0, prop.share)
    }
    arms = [k for k, name in enumerate(op3.joint_names) if "sho_pitch" in name]
    assert lead[prop.share][arms].max() > lead[0.0][arms].max()
    assert prop.share > 0.2
    assert lead[prop.share][legs].sum() < lead[0.0][legs].sum()
