"""A virtual actuator pulls the center of mass; servos that press in vain yield before they trip."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.torque import LONG_SATURATION
from humanoid_getup.experiments.rollouts import Feedback
from humanoid_getup.filtering.candidate import Candidate, straight_path
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.tracking import (
    PRESSING,
    LimbMap,
    Yielding,
    compute_force,
    compute_torque,
)
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit, load_robot
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


BEYOND = 1.3  # of its torque, which the pressing servo is asked for
KNEE = 13


def press(robot, limit=FULL_TORQUE, cycles=None, share=BEYOND):
    """Send one servo of the first of two robots a target out of its reach for some cycles.

    Return what was sent last, and what was asked, (2, n).
    """
    cycles = round(LONG_SATURATION / robot.control_period) if cycles is None else cycles
    yielding, stance = Yielding(robot, limit, 2), np.tile(robot.standing.joint_pos, (2, 1))
    torque = np.zeros((2, robot.n))
    torque[0, KNEE] = share * robot.max_torque[KNEE]
    target = sent = stance + robot.compute_lead(torque)
    for _ in range(cycles):
        sent = target + yielding.ease(target, sent, stance)
    return yielding, stance, target, sent


@pytest.mark.parametrize("name", ["op3", "toddlerbot"])
def test_a_servo_that_presses_yields_before_it_trips_and_nothing_else_changes(name):
    robot = load_robot(name)
    _, stance, target, sent = press(robot)
    lead = (target - stance)[0, KNEE]
    np.testing.assert_allclose((sent - stance)[0, KNEE], PRESSING / BEYOND * lead)
    np.testing.assert_array_equal(np.delete(sent, KNEE), np.delete(target, KNEE))


def test_for_a_while_it_may_press_and_it_follows_targets_within_its_reach_again(op3):
    _, _, target, sent = press(op3, cycles=round(0.5 * LONG_SATURATION / op3.control_period))
    np.testing.assert_array_equal(sent, target)
    yielding, stance, target, sent = press(op3)
    near = stance + 0.5 * PRESSING / BEYOND * (target - stance)
    np.testing.assert_array_equal(yielding.ease(near, sent, stance), np.zeros_like(near))
    np.testing.assert_array_equal(yielding.ease(target, near, stance), np.zeros_like(near))


@pytest.mark.parametrize(("by", "yields"), [("pwm", False), ("current", True)])
def test_a_weak_supply_saturates_sooner_where_the_gain_does_not_shrink_with_it(op3, by, yields):
    weak = replace(op3, supply_voltage=0.9 * op3.supply_voltage)
    _, _, target, sent = press(weak, TorqueLimit(by=by), share=0.95)
    assert np.array_equal(sent, target) is not yields


@pytest.mark.slow
def test_an_arm_that_is_caught_under_the_body_does_not_trip_its_servos(monkeypatch):
    """ToddlerBot on its front: without yielding, an elbow or a shoulder presses for too long."""
    robot = load_robot("toddlerbot")
    world = World(robot)
    fall = sample_falls(world, {"prone": 1}, np.random.default_rng(0))[0].posture
    near = load_database(robot).select(fall, 2)
    candidates = [
        Candidate(
            path=straight_path(fall, align(c.posture, fall), 3.0, robot.control_period),
            connection=c,
            assistance=0.0,
        )
        for c in near
    ]
    dynamics = DynamicsFilter(world)
    rolled = dynamics.roll_out(fall, candidates)
    assert not any(one.outcome.overloaded for one in nonempty(rolled))
    for one in rolled:  # what is played by others holds its last targets
        hold = one.target[one.moving :]
        np.testing.assert_allclose(hold, np.tile(hold[-1], (len(hold), 1)), atol=1e-12)
    monkeypatch.setattr(Yielding, "ease", lambda _, target, *__: 0.0 * target)
    pressing = dynamics.roll_out(fall, candidates)
    assert any(one.outcome.overloaded for one in pressing)
