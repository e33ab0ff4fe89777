"""Random moves stay within what joints can do, and balanced postures where they are set down."""

from collections import Counter

import numpy as np
import pytest
from made_up_states import make_state

from humanoid_getup.posture_chains.features import StandMeter
from humanoid_getup.posture_chains.goal import Goal
from humanoid_getup.posture_chains.move_player import Arrivals, MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureMove
from humanoid_getup.posture_chains.ways_up import check_lifting, find_least_share
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Robot, TorqueLimit
from robots.kinematics import lowest_points, place
from robots.quaternion import Array


def test_targets_stay_within_the_ranges_and_every_kind_is_drawn(few_moves: RandomMoves, op3: Robot):
    rng = np.random.default_rng(0)
    drawn = [few_moves.draw(op3.standing.joint_pos, rng) for _ in range(400)]
    targets = np.array([target for target, _ in drawn])
    assert np.all((targets >= op3.lower) & (targets <= op3.upper))
    counts = Counter(kind for _, kind in drawn)
    assert set(counts) == set(few_moves.kinds)
    assert counts["mirrored joints"] > counts["anywhere"]


def test_mirrored_moves_keep_both_sides_alike(few_moves: RandomMoves, op3: Robot):
    rng = np.random.default_rng(0)
    home = op3.standing.joint_pos
    drawn = [few_moves.draw(home, rng) for _ in range(200)]
    mirrored = [target for target, kind in drawn if kind in ("mirrored joints", "limbs")]
    paired = op3.mirror_index != np.arange(op3.n)
    assert len(mirrored) > 20
    for target in mirrored:
        assert np.allclose(op3.mirror_joints(target)[paired], target[paired])


def test_no_joint_is_sent_faster_than_its_servo(few_moves: RandomMoves, op3: Robot):
    rng, target = np.random.default_rng(0), op3.standing.joint_pos
    drawn = few_moves.draw_all([make_state(0.0, target=target)] * 64, 1.0, rng)
    assert len({move.duration for move in drawn}) == 1
    for move in drawn:
        assert np.all(np.abs(move.target - target) <= 4.8 * move.duration + 1e-9)
        assert few_moves.least_duration(target, move.target) <= move.duration + 1e-9


ON_GROUND = 0.002  # m
HELD, SUNK = 0.02, 0.04  # rad off the angles of a squat, with its targets and with the angles


@pytest.fixture(scope="module")
def player(world: World) -> MovePlayer:
    return MovePlayer(world, Goal(world), np.random.default_rng(0), threads=1)


def hold(player: MovePlayer, qpos: list[Array], targets: Array) -> Arrivals:
    """Hold targets (K, n) from MuJoCo positions."""
    states = [player.describe(q, target) for q, target in zip(qpos, targets, strict=True)]
    holds = [PostureMove(knots=each[None], duration=0.3, kind="hold") for each in targets]
    return player.try_out(states, holds)


def test_squats_and_crouches_stand_balanced_on_level_soles(world: World, few_moves: RandomMoves):
    postures = [*few_moves.squats.postures, *few_moves.crouches.postures]
    assert len(postures) > 10
    qpos = np.array([place(world.robot, world.model, posture) for posture in postures])
    assert np.abs(lowest_points(world.model, qpos)).max() < ON_GROUND
    found = StandMeter(world).measure(qpos)
    assert found.flatness.min() > 0.9
    assert found.offset.max() < 0.05
    bent = np.degrees(np.arccos(found.up[:, 2]))
    assert bent.max() > 30.0, "no crouch bends forward, which level soles need to be tested"


def test_targets_hold_squats_where_angles_as_targets_give_way(world, few_moves, player):
    """By hand: OP3's knees need 1.1 N·m in its deepest squat, at 15 N·m/rad."""
    postures, layout = few_moves.squats.postures, world.robot.layout(world.model)
    angles = np.array([posture.joint_pos for posture in postures])
    qpos = [place(world.robot, world.model, posture) for posture in postures]

    def measure(targets: Array) -> Array:
        held = hold(player, qpos, targets)
        assert held.rests.all()
        return np.abs(held.qpos[:, 0, layout.qpos] - angles).max(axis=1)

    assert measure(few_moves.squats.targets).max() < HELD
    assert measure(angles)[-1] > SUNK


@pytest.mark.parametrize(("kind", "most"), [("crouches", 0.9), ("props", 0.6)])
def test_crouches_and_props_rest_where_they_were_set_down(world, few_moves, player, kind, most):
    balanced = getattr(few_moves, kind)
    qpos = [place(world.robot, world.model, posture) for posture in balanced.postures]
    held = hold(player, qpos, balanced.targets)
    rests = held.rests[:, 0]
    assert rests.mean() > most  # in others, a servo is at its limit
    before = StandMeter(world).measure(np.array(qpos)[rests])
    after = StandMeter(world).measure(held.qpos[rests, 0])
    assert np.abs(after.neck - before.neck).max() < 0.03
    assert np.abs(after.offset - before.offset).max() < 0.05


def test_the_least_torque_with_which_it_rises_is_near_that_of_the_strained_joint(world, few_moves):
    found = check_lifting(world, few_moves, TorqueLimit(0.6))
    assert found.joint.endswith("knee")
    assert found.at_limit > 0.5
    least = found.factor * found.torque
    assert check_lifting(world, few_moves, TorqueLimit(least)) is None
    assert f"limit of 0.6 N·m for {found.at_limit:.0%} of the time" in found.describe()


def test_a_limit_far_below_what_lifts_the_robot_is_named(world: World, few_moves: RandomMoves):
    found = check_lifting(world, few_moves, TorqueLimit(0.05))
    assert found.factor * found.torque > 1.0
    assert found.at_limit > 0.5


def test_a_robot_is_judged_with_no_less_torque_than_lifts_it_out_of_most_squats(world, few_moves):
    """OP3 rises with 61 % of its torque; with a sixth of it, from its highest squats alone."""
    assert find_least_share(world, few_moves, FULL_TORQUE, (0.15, 0.61)) == 0.61
    assert find_least_share(world, few_moves, TorqueLimit(0.05), (0.9,)) == 1.0
