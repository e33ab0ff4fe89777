"""Rewards, worked out by hand on made-up moments."""

from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from robots.kinematics import place
from sim2real.environment.rewards import (
    MOST_REQUESTED,
    NECK_LOW,
    REWARDS,
    SOLES_LOW,
    UNDER_TORSO,
    RewardInputs,
    StyleReward,
    action_change,
    at_ease,
    demanding,
    dropping,
    haste,
    head_strike,
    joint_speed,
    over_feet,
    restless,
    reward_style,
    score,
    stance,
    stands,
    torque,
    way_up,
)
from sim2real.environment.training_simulation import TrainingSim

STANDING = RewardInputs(
    height=np.array([1.0]),
    stretch=np.array([1.0]),
    sole_height=np.array([0.0]),
    sole_heights=np.zeros((1, 2)),
    sole_distance=np.array([0.0]),
    upright=np.array([1.0]),
    standing=np.array([True]),
    non_foot_contact=np.array([False]),
    root_vel=np.zeros((1, 6)),
    joint_speed=np.zeros((1, 2)),
    torque=np.zeros((1, 2)),
    fall_speed=np.zeros(1),
    head_contact=np.array([False]),
    head_fall=np.zeros(1),
    requested=np.zeros((1, 2)),
    action=np.zeros((1, 2)),
    last_action=np.zeros((1, 2)),
    away=np.zeros((1, 2)),
)


def follow(height: float) -> StyleReward:
    """Follow curves that ask for a stand, by height alone."""
    one = np.ones(1)
    return StyleReward(height=height * one, angles=one, stillness=one, posture=one, natural=one)


STANDING = replace(STANDING, style=follow(1.0))
# Two thirds of the standing height, upright, legs stretched out forward.
SITTING = replace(
    STANDING,
    height=np.array([0.66]),
    stretch=np.array([0.6]),
    sole_height=np.array([0.06]),
    sole_distance=np.array([0.8]),
    standing=np.array([False]),
    away=np.full((1, 2), 1.0),
    style=follow(0.4),
)
LYING = replace(
    SITTING,
    height=np.array([0.15]),
    stretch=np.array([0.1]),
    upright=np.array([0.0]),
    style=follow(0.1),
)


ONE_MOVES = np.array([[0.5, 0.0]])


def change(**fields: object) -> RewardInputs:
    return replace(STANDING, **{name: np.atleast_1d(value) for name, value in fields.items()})


COSTS = {
    torque: change(torque=[[1.0, 0.0]]),
    head_strike: change(head_fall=2.0, height=0.0),
    dropping: change(fall_speed=2.0),
    haste: change(requested=[[1.0, 0.0]]),
    demanding: change(requested=[[1.0, 0.0]]),
    action_change: change(action=[[1.0, 0.0]], last_action=[[-1.0, 0.0]]),
    joint_speed: change(joint_speed=[[0.5, -0.5]]),
    restless: change(joint_speed=[[0.5, -0.1]], away=[[0.2, -0.1]]),
}


@pytest.mark.parametrize(
    ("term", "moment", "value"),
    [
        (way_up, STANDING, 1.0),
        (way_up, change(height=0.5), 0.25),
        (way_up, change(height=1.4), 1.0),  # a jump earns no more than a stand
        (way_up, change(upright=0.0), 0.5),
        (way_up, change(sole_height=SOLES_LOW), 1.0 / np.e),
        (over_feet, STANDING, 1.0),
        (over_feet, change(stretch=0.5), 0.25),
        (over_feet, change(sole_distance=UNDER_TORSO), 1.0 / np.e),
        (over_feet, change(stretch=-0.5), 0.0),  # head down, feet up
        (stands, STANDING, 1.0),
        (stands, SITTING, 0.0),
        (stance, change(away=[[0.0, 0.5**0.5]]), 0.5 * (1.0 + 1.0 / np.e)),  # each joint counts
        (at_ease, SITTING, 0.0),
        (at_ease, change(away=[[0.0, -np.pi / 4.0]]), 0.5 * (1.0 + 0.75)),
        (haste, COSTS[haste], 0.5),
        (haste, change(requested=[[MOST_REQUESTED + 5.0, -MOST_REQUESTED]]), MOST_REQUESTED**2),
        (demanding, COSTS[demanding], 0.5),
        (demanding, replace(SITTING, requested=ONE_MOVES), 0.0),
        (stance, SITTING, 0.0),
        (action_change, COSTS[action_change], 2.0),
        (joint_speed, COSTS[joint_speed], 0.25),
        (restless, COSTS[restless], 0.3),
        (restless, change(joint_speed=[[0.5, -0.1]], away=[[0.2, 0.1]]), 0.25),  # one comes home
        (restless, replace(SITTING, joint_speed=ONE_MOVES, away=ONE_MOVES), 0.0),
        (torque, COSTS[torque], 0.5),
        (dropping, COSTS[dropping], 4.0),
        (head_strike, COSTS[head_strike], 4.0),
        (head_strike, change(head_fall=2.0, height=NECK_LOW), 4.0 / np.e),
    ],
)
def test_a_term_worked_out_by_hand(term, moment, value):
    assert term(moment) == pytest.approx([value])


def test_sitting_earns_less_than_standing_and_more_than_lying():
    for name, rewards in nonempty(REWARDS.items()):
        standing, sitting, lying = (
            score(rewards, moment)[0].item() for moment in (STANDING, SITTING, LYING)
        )
        assert standing > 2.0 * sitting, name
        assert sitting > lying, name


def test_costs_cost_and_rewards_pay_in_every_recipe():
    for name, rewards in nonempty(REWARDS.items()):
        for reward in nonempty(rewards):
            part = score((reward,), COSTS.get(reward.term, STANDING))[0].item()
            assert part < 0.0 if reward.term in COSTS else part > 0.0, (name, reward.term)
        charged = {reward.term for reward in rewards} & COSTS.keys()
        assert len(charged) == {"quick": 2, "styled": 6}.get(name, 8)


def place_one(op3, world, qpos: np.ndarray, **qvel: float | np.ndarray) -> TrainingSim:
    """Place a robot that moves: its torso upwards by ``up``, its joints by ``joints``."""
    sim, layout = TrainingSim(world, 1, cycles=6, threads=1), op3.layout(world.model)
    moving = np.zeros((1, world.model.nv))
    moving[:, layout.root_dof + 2] = qvel.get("up", 0.0)
    moving[:, layout.dof] = qvel.get("joints", 0.0)
    sim.place(np.array([0]), qpos[None], moving)
    return sim


def test_a_moment_is_counted_in_the_robots_own_measures(op3, world, falls):
    size, standing = op3.standing_neck_height, place(op3, world.model, op3.standing)
    standing[2] += 0.1 * size
    state = place_one(op3, world, standing, up=-0.3).measure_privileged_state()
    assert state.height == pytest.approx([1.1], abs=0.01)
    assert state.stretch == pytest.approx([1.0], abs=0.01)
    assert state.sole_height == pytest.approx([0.1], abs=0.01)
    assert state.sole_heights == pytest.approx(np.full((1, 2), 0.1), abs=0.01)
    assert state.sole_distance == pytest.approx([0.0], abs=0.1)
    assert state.upright == pytest.approx([1.0], abs=0.02)
    assert not state.standing[0], "in the air"
    assert not state.non_foot_contact[0]
    assert state.fall_speed == pytest.approx([0.3 / size])
    assert state.head_fall == pytest.approx([0.3 / size])
    turning = place_one(op3, world, standing, joints=op3.max_velocity).measure_privileged_state()
    assert turning.joint_speed == pytest.approx(np.ones((1, op3.n)))
    sim = place_one(op3, world, falls[0], up=0.4)
    assert sim.measure_privileged_state().fall_speed.tolist() == [0.0], "only downwards is a fall"
    target = falls[:1, op3.layout(world.model).qpos]
    sim.follow(target, target + 0.2)
    assert np.abs(sim.torque).max() > 0.5
    assert sim.measure_privileged_state().torque == pytest.approx(sim.torque / op3.max_torque)
    lying = place_one(op3, world, falls[0])
    lying.follow(target, target)
    assert lying.measure_privileged_state().non_foot_contact.tolist() == [True]


def follow_curve(height=0.0, side=0.0, front=0.0, *, wanted=0.5, speed=0.0, away=0.0, offset=0.0):
    target = np.array([[wanted, np.pi / 2, np.pi / 2]])
    return reward_style(
        target + np.array([[height, side, front]]),
        target,
        np.array([[speed, 0.0]]),
        np.array([[away, away]]),
        np.full((1, 20), offset),
    )


def test_the_reward_is_that_of_the_paper_by_hand():
    assert follow_curve().total == pytest.approx([1.0])
    assert follow_curve(height=-0.2).total == pytest.approx([np.exp(-0.5)])  # 2.5 per neck height
    assert follow_curve(side=0.2, front=-0.4).total == pytest.approx([np.exp(-0.9)])  # equation (6)
    # While the curve asks for half the height, (8) is exp(-10): speed and posture do not count.
    assert follow_curve(speed=9.0, away=2.0).task == pytest.approx([1.0], abs=1e-4)
    # At the end it is 1: (7) is exp(-0.05 |w|), (9) is exp(-0.1 sum |q|).
    assert follow_curve(wanted=1.0, speed=9.0).task == pytest.approx([np.exp(-0.45)])
    assert follow_curve(wanted=1.0, away=2.0).task == pytest.approx([np.exp(-0.4)])
    # The end is that of the curve, wherever the robot is.
    low, early = (follow_curve(height=h, wanted=w, speed=9.0) for h, w in ((-0.4, 1.0), (0.5, 0.5)))
    assert low.stillness == pytest.approx([np.exp(-0.45)])
    assert early.stillness == pytest.approx([1.0], abs=1e-4)
    # (3): the naturalness falls with the square of the mean offset, to 0 at 0.2 rad.
    assert follow_curve(offset=0.1).natural == pytest.approx([0.75])
    assert follow_curve(offset=0.5).total == pytest.approx([0.0])
