"""An archive keeps the best state of each cell, and draws those that are ahead."""

import numpy as np
import pytest
from made_up_states import make_move, make_state

from humanoid_getup.posture_chains.resting_state import Archive, PostureChain


def test_a_cell_keeps_the_state_that_is_clearly_ahead():
    archive = Archive()
    first = make_state(0.5, depth=3)
    assert archive.add(first)
    assert not archive.add(make_state(0.51, depth=3))
    assert list(archive) == [first]
    assert archive.add(ahead := make_state(0.6, depth=9))
    assert list(archive) == [ahead]


def test_a_cell_keeps_the_shorter_chain_to_a_state_that_is_as_far():
    archive = Archive()
    archive.add(make_state(0.5, depth=3))
    assert archive.add(make_state(0.49, depth=2))
    assert not archive.wants(make_state(0.4, depth=1))


def test_states_that_are_ahead_are_drawn_more_often_and_those_drawn_often_less():
    archive, rng = Archive(), np.random.default_rng(0)
    states = [make_state(k / 40, cell=(k,)) for k in range(40)]
    for state in states:
        archive.add(state)
    first = archive.draw(400, rng)
    counts = [sum(s is state for s in first) for state in states]
    assert sum(counts[-8:]) > 2 * sum(counts[:8])
    later = archive.draw(400, rng)
    assert sum(s in states[-8:] for s in later) < sum(counts[-8:])


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
