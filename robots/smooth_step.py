"""The smooth step: a share that begins and ends level."""

from __future__ import annotations

import numpy as np

from robots.quaternion import Array


def smooth_step(share: Array) -> Array:
    """Map shares from 0 to 1 to shares that leave 0 and reach 1 at rest, any shape.

    The cubic 3 x² - 2 x³; below 0 it is 0, above 1 it is 1.
    """
    share = np.clip(share, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)
