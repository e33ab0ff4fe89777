"""The smooth step: a share with zero slope at its beginning and end."""

from __future__ import annotations

import numpy as np

from robots.quaternion import Array


def smooth_step(share: Array) -> Array:
    """Map shares from 0 to 1 to shares with zero slope at 0 and 1, any shape.

    The cubic 3 x² - 2 x³; below 0 it is 0, above 1 it is 1.
    """
    share = np.clip(share, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def invert_smooth_step(value: Array) -> Array:
    """Map values of the smooth step from 0 to 1 to their shares, any shape."""
    return 0.5 - np.sin(np.arcsin(1.0 - 2.0 * value) / 3.0)
