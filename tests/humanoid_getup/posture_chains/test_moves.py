"""Random moves stay within what joints can do."""

from collections import Counter

import numpy as np
from made_up_states import make_state

from humanoid_getup.posture_chains.moves import RandomMoves
from robots import Robot


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
