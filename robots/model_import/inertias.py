"""Inertias that no link of its mass and shape can have, and those that replace them."""

from __future__ import annotations

import numpy as np

from robots.quaternion import Array

BEYOND = 2.0  # times the reach of a link's shapes, where all of its mass had to be
WIDEST = 0.4  # of the robot's height, up to which a small link's inertia may be a placeholder


def find_excess(inertia: Array, mass: float, points: Array, height: float) -> float:
    """Find how many times an inertia is that of a box about a link's shapes, if it cannot be.

    That of a small link may be larger than its shapes permit, if not than the robot does.

    Args:
        inertia: About the center of mass [kg·m²], (3, 3).
        mass: [kg]
        points: They span the link's shapes, from the center of mass [m], (p, 3).
        height: Of the robot [m].

    Returns:
        0 where it can be, or without shapes.
    """
    largest = float(np.linalg.eigvalsh(inertia).max())
    reach = float(np.linalg.norm(points, axis=1).max(initial=0.0))
    if not reach or largest <= mass * max(BEYOND * reach, WIDEST * height) ** 2:
        return 0.0
    return largest / float(compute_box_inertia(mass, points).max())


def compute_box_inertia(mass: float, points: Array) -> Array:
    """Compute the inertia of a uniform box that holds points, (3, 3) [kg·m²]."""
    sides = np.square(np.ptp(points, axis=0))
    return mass / 12.0 * np.diag(sides.sum() - sides)
