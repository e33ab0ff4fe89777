"""Stretching along a direction: of points, and of distributed mass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

NODES = 32  # of the quadrature along each axis; 2 are exact where a whole body is stretched


@dataclass(frozen=True)
class AxialStretch:
    """A map of points that moves them along a direction, away from or towards a plane."""

    origin: Array
    """A point that stays [m], shape (3,)."""
    direction: Array
    """Unit vector, shape (3,)."""
    factor: float
    beyond: bool = False
    """Whether only points beyond the plane through ``origin`` are stretched."""

    def __call__(self, points: Array) -> Array:
        """Move points (..., 3) [m]."""
        height = (points - self.origin) @ self.direction  # (...)
        stretched = np.maximum(height, 0.0) if self.beyond else height
        return points + (self.factor - 1.0) * stretched[..., None] * self.direction

    def growth(self, points: Array) -> Array:
        """Compute the factor on length, and so on mass, at points (..., 3), (...)."""
        height = (points - self.origin) @ self.direction
        return (
            np.where(height < 0.0, 1.0, self.factor)
            if self.beyond
            else np.full_like(height, self.factor)
        )

    def seen_from(self, position: Array, axes: Array) -> AxialStretch:
        """Express it in a frame at a position (3,) with axes in columns, (3, 3)."""
        origin = axes.T @ (self.origin - position)
        return replace(self, origin=origin, direction=axes.T @ self.direction)

    def extend(self, center: Array, half: Array) -> tuple[Array, Array]:
        """Stretch a straight piece: the point between its ends, and the vector to one, (3,)."""
        start, end = self(np.stack([center - half, center + half]))
        return 0.5 * (start + end), 0.5 * (end - start)


@dataclass(frozen=True)
class Inertia:
    """How mass is distributed in a body."""

    mass: float
    """[kg]"""
    center: Array
    """Center of mass [m], shape (3,)."""
    spread: Array
    """Integral of r rᵀ dm about the center of mass [kg·m²], shape (3, 3)."""

    @classmethod
    def from_principal(cls, mass: float, center: Array, axes: Array, moments: Array) -> Inertia:
        """Make it from principal moments [kg·m²], (3,), about axes in columns, (3, 3)."""
        spread = axes @ np.diag(0.5 * moments.sum() - moments) @ axes.T
        return cls(mass, center, spread)

    def principal(self) -> tuple[Array, Array]:
        """Compute the principal moments [kg·m²], (3,), and axes as a quaternion, (4,)."""
        spread, axes = np.linalg.eigh(self.spread)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, axes.ravel())
        return spread.sum() - spread, quat

    def stretched(
        self, stretch: AxialStretch, where: Callable[[Array], NDArray[np.bool_]] | None = None
    ) -> Inertia:
        """Compute the inertia of the stretched material; its density stays the same.

        The material is taken as the uniform box that has this inertia. That is exact where all
        of it is stretched: the second moment S of mass m becomes f A S Aᵀ, of mass f m, with
        A = 1 + (f - 1) u uᵀ.

        Args:
            stretch: What is done to the material.
            where: Tells at which points (K, 3) it is; ``None`` for everywhere.
        """
        points, weights = self._sample()
        chosen = np.ones(len(points), dtype=bool) if where is None else where(points)
        moved = np.where(chosen[:, None], stretch(points), points)
        weights = weights * np.where(chosen, stretch.growth(points), 1.0)
        mass = weights.sum()
        center = weights @ moved / mass
        away = moved - center
        return Inertia(float(mass), center, (weights[:, None] * away).T @ away)

    def _sample(self) -> tuple[Array, Array]:
        """Sample points (K, 3) of the uniform box with this inertia, and their masses (K,)."""
        spread, axes = np.linalg.eigh(self.spread)
        half = np.sqrt(3.0 * np.maximum(spread, 0.0) / self.mass)
        nodes, weights = _box_nodes()
        return self.center + (nodes * half) @ axes.T, self.mass * weights


@cache
def _box_nodes() -> tuple[Array, Array]:
    """Return points (K, 3) of the box [-1, 1]³ and weights (K,) that sum to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid, np.einsum("i,j,k->ijk", weights, weights, weights).ravel() / 8.0
