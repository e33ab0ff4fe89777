"""Statics: their torques hold the robot in MuJoCo; squats and props are balanced."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.simulation.world import World
from robots import Robot, load_robot, quaternion
from robots.body.drawn_postures import MOST_DOWN, Prop, draw_props
from robots.body.limbs import LEGS, Limbs
from robots.body.squats import Squat, list_squats
from robots.body.statics import Statics
from robots.kinematics import place
from robots.quaternion import Array

HELD = 0.05  # s: a squat without torque falls by several millimeters


def fall(robot: Robot, joint_pos: Array, torque: Array) -> float:
    """Return by how much joints move [rad] under constant torques, servos off, on flat ground."""
    model = World(robot).model
    model.actuator_forcerange[:], model.actuator_forcelimited[:] = 0.0, 1
    model.dof_frictionloss[:] = 0.0
    data, layout = mujoco.MjData(model), robot.layout(model)
    data.qpos[:] = place(robot, model, Statics(robot).make_posture(joint_pos))
    data.qfrc_applied[layout.dof] = torque
    while data.time < HELD:
        mujoco.mj_step(model, data)
    return float(np.abs(data.qpos[layout.qpos] - joint_pos).max())


@pytest.fixture(scope="module")
def squats(op3: Robot) -> list[Squat]:
    return list_squats(Limbs(op3), Statics(op3))


@pytest.mark.parametrize("depth", [0, 4, -1])
def test_the_torques_of_a_squat_hold_it_in_simulation(depth: int, squats: list[Squat], op3: Robot):
    squat = squats[depth]
    held = fall(op3, squat.joint_pos, squat.torque)
    assert held < 0.1 * fall(op3, squat.joint_pos, 0.0 * squat.torque)


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_a_robot_that_leans_to_a_side_puts_more_of_its_weight_there(op3: Robot, way: float):
    """The hips' torques, by hand: each sole carries the share that keeps the lateral balance."""
    rolls = [f"{side}_{joint}_roll" for side in "lr" for joint in ("hip", "ank")]
    angles = op3.standing.joint_pos.copy()
    angles[[op3.joint_names.index(name) for name in rolls]] += 0.15 * way
    statics, model = Statics(op3), op3.spec().compile()
    data = mujoco.MjData(model)
    data.qpos[:] = place(op3, model, statics.make_posture(angles))
    mujoco.mj_forward(model, data)
    center = data.subtree_com[op3.layout(model).torso][1]
    y = {side: data.site(f"{side}_sole").xpos[1] for side in "lr"}
    shares = {
        "l": (center - y["r"]) / (y["l"] - y["r"]),
        "r": (y["l"] - center) / (y["l"] - y["r"]),
    }
    assert abs(shares["l"] - shares["r"]) > 0.3
    found = statics.measure_torques(angles)
    for side in "lr":
        hip = model.joint(f"{side}_hip_roll")
        leg, at = int(hip.bodyid[0]), data.xanchor[hip.id][1]
        pressed = shares[side] * statics.weight * (y[side] - at)
        by_hand = pressed - 9.81 * model.body_subtreemass[leg] * (data.subtree_com[leg][1] - at)
        torque = found[op3.joint_names.index(f"{side}_hip_roll")]
        assert torque * data.xaxis[hip.id][0] == pytest.approx(-by_hand, abs=0.02)


def test_a_posture_is_on_the_ground_at_the_origin_and_its_neck_as_high_as_the_stance(
    squats: list[Squat], op3: Robot
):
    statics, model = Statics(op3), op3.spec().compile()
    stance = statics.make_posture(op3.standing.joint_pos)
    assert stance.position[:2].tolist() == [0.0, 0.0]
    assert stance.position[2] == pytest.approx(op3.standing.position[2], abs=1e-3)
    assert statics.measure_neck(op3.standing.joint_pos) == pytest.approx(1.0, abs=1e-3)
    squat = squats[-1]
    data = mujoco.MjData(model)
    data.qpos[:] = place(op3, model, statics.make_posture(squat.joint_pos))
    mujoco.mj_kinematics(model, data)
    soles = [data.site(site).xpos[2] for site in op3.sole_sites]
    assert soles == pytest.approx([0.0, 0.0], abs=1e-4)
    share = (data.site(op3.neck_site).xpos[2] - min(soles)) / op3.standing_neck_height
    assert statics.measure_neck(squat.joint_pos) == pytest.approx(share, abs=1e-6)
    assert share < 0.9


def test_what_a_passive_joint_carries_is_handed_to_the_one_that_it_follows(
    op3: Robot, tmp_path: Path
):
    """The oracle: static torques are the slopes of the potential energy, the torso held still.

    Before the tail there is an ear that follows nothing.
    """
    tail = (
        '<body name="ear" pos="0 0 0.1"><joint name="ear" axis="0 1 0"/>'
        '<geom type="sphere" pos="-0.1 0 0" size="0.01" mass="0.1"/></body>'
        '<body name="tail" pos="-0.1 0 0.05"><joint name="tail" axis="0 1 0"/>'
        '<geom type="sphere" pos="-0.1 0 0" size="0.01" mass="0.3"/></body>'
    )
    coupling = '<equality><joint joint1="tail" joint2="head_tilt" polycoef="0 2 0 0 0"/></equality>'
    head = '<body name="head_pan_link"'
    text = op3.model_file.read_text("utf-8").replace(head, tail + head)
    text = text.replace("</worldbody>", f"</worldbody>{coupling}")
    (tmp_path / "model.xml").write_text(text, "utf-8")
    toml = (op3.folder / "robot.toml").read_text("utf-8")
    toml = toml.replace(
        'torso = "body_link"', 'torso = "body_link"\npassive_joints = ["ear", "tail"]'
    )
    (tmp_path / "robot.toml").write_text(toml, "utf-8")
    tailed = load_robot(tmp_path)
    model, step, k = tailed.spec().compile(), 1e-4, tailed.joint_names.index("head_tilt")
    data, stance = mujoco.MjData(model), tailed.standing

    def potential(joint_pos: Array) -> float:
        data.qpos[:] = place(tailed, model, replace(stance, joint_pos=joint_pos))
        mujoco.mj_forward(model, data)
        return float(9.81 * np.sum(model.body_mass * data.xipos[:, 2]))

    shift = step * np.eye(tailed.n)[k]
    slope = potential(stance.joint_pos + shift) - potential(stance.joint_pos - shift)
    found = Statics(tailed).measure_torques(stance.joint_pos)[k]
    assert found == pytest.approx(slope / (2.0 * step), abs=1e-3)
    assert abs(found) > 0.4  # 2 x 0.3 kg x 9.81 m/s² x 0.1 m, less as the tail hangs, and the head


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


def test_squats_go_from_high_to_deep_their_mass_over_parallel_soles(
    squats: list[Squat], limbs: Limbs
):
    heights = [squat.neck_share for squat in squats]
    assert len(heights) >= 8
    assert heights == sorted(heights, reverse=True)
    assert heights[-1] < 0.75
    left, right = (limbs.leg(name) for name in LEGS)
    for squat in nonempty(squats):
        ahead = limbs.measure_balance(squat.joint_pos)
        assert ahead is not None and abs(ahead) < 0.05, squat.neck_share
        assert left.sole_axes[:, 2] @ right.sole_axes[:, 2] > 0.999
        assert abs(left.sole_position[0] - right.sole_position[0]) < 0.01


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
