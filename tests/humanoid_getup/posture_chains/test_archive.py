"""An archive keeps the best state of each cell, and draws those that are ahead."""

import numpy as np
from made_up_states import make_state

from humanoid_getup.posture_chains.archive import Archive


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
