"""Boundary B: does the network return what the trace says for its observation?"""

from __future__ import annotations

import numpy as np

from humanoid_getup.policy.golden.comparison import Boundary, Comparison
from humanoid_getup.policy.golden.order_search import find_order, name_order
from humanoid_getup.policy.golden.replayed import ReplayedPolicy
from robots.quaternion import Array

SLACK = 5e-3  # of the largest action, at least of 1


def check_action(replayed: ReplayedPolicy) -> Comparison:
    """Compare the actions of a trace with those of the network on the same observations."""
    recorded, found = replayed.trace.action, replayed.step(replayed.signals).action
    limit = SLACK * max(1.0, float(np.abs(found).max()))
    difference = float(np.abs(recorded - found).max())
    agrees = difference <= limit
    cause = "" if agrees else _explain(replayed, recorded, found, limit)
    return Comparison(boundary=Boundary.ACTION, agrees=agrees, difference=difference, cause=cause)


def _explain(replayed: ReplayedPolicy, recorded: Array, found: Array, limit: float) -> str:
    if np.abs(recorded[1:] - found[:-1]).max() <= limit:
        return "actions are one policy step late in the trace"
    factor = float((recorded * found).sum() / max((found * found).sum(), 1e-12))
    if np.abs(recorded - factor * found).max() <= limit:
        return f"actions are {factor:.3g} times as large in the trace: a scale is counted twice"
    if np.abs(recorded - np.clip(found, -1.0, 1.0)).max() <= limit:
        return "actions are clipped to -1 and 1 in the trace"
    made = np.repeat(found.T[:, :, None], found.shape[1], axis=2)
    order = find_order(recorded, made, limit)
    if order is not None:
        record = replayed.record
        return name_order(record.moved if record else replayed.policy.action.names, order)
    return "another network: the same observation gives other actions"
