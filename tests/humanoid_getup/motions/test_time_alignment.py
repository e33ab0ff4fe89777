"""Alignment in time: how far two motions are apart where one may be quicker than the other."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.motions.time_alignment import align, find_nearest, measure_distance
from robots import Robot


def test_the_cheapest_way_is_that_of_all_ways():
    rng = np.random.default_rng(0)
    for rows, columns in ((3, 4), (4, 2), (1, 3)):
        cost = rng.uniform(size=(rows, columns))
        pairs = align(cost)
        steps = np.diff(pairs, axis=0)
        assert (pairs[0] == 0).all() and tuple(pairs[-1]) == (rows - 1, columns - 1)
        assert {tuple(step) for step in steps.tolist()} <= {(1, 1), (1, 0), (0, 1)}
        found = cost[pairs[:, 0], pairs[:, 1]].sum()
        assert found == pytest.approx(min(_list_sums(cost)))


def _list_sums(cost: np.ndarray) -> list[float]:
    """List the sums along all monotone ways, one by one."""
    rows, columns = cost.shape
    if rows == columns == 1:
        return [float(cost[0, 0])]
    before = [
        cost[:i, :j]
        for i, j in ((rows - 1, columns - 1), (rows - 1, columns), (rows, columns - 1))
        if i and j
    ]
    return [total + float(cost[-1, -1]) for part in before for total in _list_sums(part)]


def test_a_slower_copy_is_no_distance_away_and_another_rise_is(op3: Robot):
    metric = PostureMetric.of(op3)
    rise = find_motion(op3, "prone_push_up_gentle")
    slower = replace(
        rise,
        time=2.0 * rise.time,
        provenance=rise.provenance | {"stand_time_s": 2.0 * rise.stand_time},
    )
    others = [find_motion(op3, name) for name in ("supine_roll_over", "lateral_side_sit")]
    assert measure_distance(rise, slower, metric) == pytest.approx(0.0, abs=1e-9)
    apart = [measure_distance(*pair, metric) for pair in combinations([rise, *others], 2)]
    assert min(apart) > 0.5
    assert find_nearest(rise, [*others, slower], metric)[1] is slower
    assert find_nearest(rise, [], metric) is None
