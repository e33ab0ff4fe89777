"""Balanced postures stand on the ground, and their targets hold them there."""

import numpy as np
import pytest

from humanoid_getup.posture_chains.features import StandMeter
from humanoid_getup.posture_chains.move_player import Arrivals, MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureMove
from humanoid_getup.simulation.world import World
from robots.kinematics import lowest_points, place
from robots.quaternion import Array

ON_GROUND = 0.002  # m
HELD, SUNK = 0.02, 0.04  # rad off the angles of a squat, with its targets and with the angles


@pytest.fixture(scope="module")
def player(world: World) -> MovePlayer:
    return MovePlayer(world, StandMeter(world), np.random.default_rng(0), threads=1)


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
