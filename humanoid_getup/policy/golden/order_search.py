"""Finds orders in which two programs have the same joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from robots.quaternion import Array

MOST_NAMED = 6  # joints of another order that are named


def find_order(recorded: Array, made: Array, limit: float) -> list[int] | None:
    """Find which joint each recorded column is of; None if no order explains all.

    Args:
        recorded: Columns of a trace, (T, n).
        made: Columns as they would be if each were of one joint, (n, T, n), by joint.
        limit: Largest difference that counts as none.
    """
    error = np.abs(made - recorded).max(axis=1).T  # (column, joint)
    columns, joints = linear_sum_assignment(error)
    order = joints.tolist()
    if error[columns, joints].max() > limit or order == sorted(order):
        return None
    return order


def name_order(names: Sequence[str], order: Sequence[int]) -> str:
    """Name the joints that are in other places."""
    moved = [i for i, joint in enumerate(order) if i != joint]
    if len(moved) == 2:
        return f"joints '{names[moved[0]]}' and '{names[moved[1]]}' are swapped"
    listed = ", ".join(f"'{names[order[i]]}' for '{names[i]}'" for i in moved[:MOST_NAMED])
    return f"joints are in another order: {listed}{' ...' if len(moved) > MOST_NAMED else ''}"
