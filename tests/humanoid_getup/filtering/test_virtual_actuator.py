import mujoco
import numpy as np
import pytest

from humanoid_getup.experiments.rollouts import Feedback
from humanoid_getup.filtering.tracking import LimbMap, compute_force, compute_torque
from humanoid_getup.simulation.world import World
from robots.kinematics import place


def _observe(world: World, joint_pos: np.ndarray, touching: list[str]) -> Feedback:
    """Look at a standing robot whose named limbs hold the world at their soles."""
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    layout = robot.layout(model)
    data.qpos[layout.qpos] = joint_pos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    ids = [model.joint(name).id for name in robot.joint_names]
    point = np.zeros((1, len(world.limbs), 3))
    touch = np.zeros((1, len(world.limbs)), dtype=bool)
    for i, limb in enumerate(world.limbs):
        if limb in touching:
            touch[0, i] = True
            point[0, i] = data.site(f"{limb[0]}_sole").xpos
    return Feedback(
        step=0,
        joint_pos=joint_pos[None],
        com=data.subtree_com[None].copy(),
        axis=data.xaxis[None, ids].copy(),
        anchor=data.xanchor[None, ids].copy(),
        limb_touch=touch,
        limb_point=point,
    )


def _com_over_sole(world: World, joint_pos: np.ndarray, sole: str) -> np.ndarray:
    """Compute the center of mass from a sole, the torso's attitude kept [m], (3,)."""
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    data.qpos[robot.layout(model).qpos] = joint_pos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data.subtree_com[robot.layout(model).torso] - data.site(sole).xpos


def test_a_leg_turns_force_into_the_torques_of_the_numeric_jacobian(world):
    robot = world.robot
    joint_pos = robot.standing.joint_pos
    seen = _observe(world, joint_pos, ["l_hip_yaw_link"])
    force = np.array([1.0, -2.0, 3.0])
    torque = compute_torque(seen, force[None], LimbMap.of(world))[0]
    legs = [
        i for i, name in enumerate(robot.joint_names) if name[:5] in ("l_hip", "l_kne", "l_ank")
    ]
    assert len(legs) == 6
    for joint in legs:
        step = np.zeros(robot.n)
        step[joint] = 1e-5
        moved = _com_over_sole(world, joint_pos + step, "l_sole")
        back = _com_over_sole(world, joint_pos - step, "l_sole")
        column = (moved - back) / 2e-5
        assert torque[joint] == pytest.approx(column @ force, abs=1e-6)


def test_limbs_in_the_air_get_no_torque(world):
    seen = _observe(world, world.robot.standing.joint_pos, ["l_hip_yaw_link", "r_hip_yaw_link"])
    torque = compute_torque(seen, np.array([[0.0, 0.0, 10.0]]), LimbMap.of(world))[0]
    names = world.robot.joint_names
    in_air = [i for i, name in enumerate(names) if "sho" in name or "el" in name or "head" in name]
    assert np.all(torque[in_air] == 0.0)
    assert np.abs(torque).max() > 0.1


def test_two_legs_share_a_force_evenly(world):
    robot = world.robot
    seen = _observe(world, robot.standing.joint_pos, ["l_hip_yaw_link", "r_hip_yaw_link"])
    torque = compute_torque(seen, np.array([[0.0, 0.0, 20.0]]), LimbMap.of(world))[0]
    np.testing.assert_allclose(torque, robot.mirror_joints(torque), atol=0.02)


def test_the_wish_pulls_home_and_is_bounded():
    zero = np.zeros((1, 3))
    far = compute_force(zero, zero, np.array([[10.0, 0.0, 0.0]]), zero, mass=3.0)
    assert far[0, 0] == pytest.approx(0.5 * 3.0 * 9.81)
    near = compute_force(zero, zero, np.array([[0.0, 0.01, 0.0]]), zero, mass=3.0)
    assert near[0, 1] == pytest.approx(3.0 * 16.0 * 0.01)
    falling = compute_force(zero, np.array([[0.0, 0.0, -0.5]]), zero, zero, mass=3.0)
    assert falling[0, 2] > 0.0
