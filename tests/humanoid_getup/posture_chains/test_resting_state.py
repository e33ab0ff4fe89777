"""Moves between resting states, and the chains and ways up that they form."""

import numpy as np
import pytest
from made_up_states import make_move, make_state

from humanoid_getup.posture_chains.resting_state import PostureChain


def test_a_move_passes_its_postures_in_time_and_then_rests():
    sampled = make_move(2.0, 1.0).sample(np.array([0.0]), period=0.01, rest=0.5)[:, 0]
    assert len(sampled) == 150
    assert sampled[49] == pytest.approx(2.0)  # a smooth step is half way at half the time
    assert sampled[24] == pytest.approx(2.0 * 2 * (3 * 0.25**2 - 2 * 0.25**3))
    assert np.all(sampled[99:] == 1.0)


def test_a_chain_is_the_way_from_its_start():
    first = make_state(0.0)
    second = make_state(0.5, before=first, move=make_move(0.5), depth=1)
    third = make_state(1.0, before=second, move=make_move(1.0, duration=2.0), depth=2)
    assert third.path == [first, second, third]
    chain = third.chain
    assert isinstance(chain, PostureChain)
    assert chain.duration == 3.0
    assert chain.start is first.qpos
    sampled = chain.sample(period=0.1, rest=0.2)[:, 0]
    assert len(sampled) == 34
    assert sampled[11] == 0.5
    assert sampled[-1] == 1.0


def test_a_way_up_leads_through_what_is_left_to_a_stand():
    stance = make_state(1.0)
    squat = make_state(0.5, after=stance, onward=make_move(1.0), depth=1)
    sitting = make_state(0.2, after=squat, onward=make_move(0.5), depth=2)
    assert sitting.root is stance
    assert sitting.leads_through(squat)
    assert not squat.leads_through(sitting)
