"""The ground of a scene: a plane, level or sloping, or a field of heights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from robots import quaternion
from robots.ground import GROUND, GROUND_FRICTION, add_ground, add_world_geom
from robots.quaternion import Array

SOFT_IMPEDANCE = 0.3  # of a soft surface; small, so that it acts like a spring
TORSIONAL_FRICTION = 0.005  # m, MuJoCo's own
GRAVITY = 9.81  # m/s²
SINKS = 2.0  # depths to which a body sinks into what is soft; its lighter parts sink deeper
POINTS = 4  # of contact, on which a body rests that sinks as deep as a surface says


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Friction and softness of the ground or of an obstacle."""

    friction: float = GROUND_FRICTION
    """Sliding friction in every contact."""
    rolling_friction: float = 0.0
    """Torque against rolling per normal force [m]."""
    sink: float = 0.0
    """Depth to which a body that rests on four points sinks in [m]; 0 is rigid. A light limb of a
    robot, which the rest presses down, sinks deeper."""

    @property
    def deepest_sink(self) -> float:
        """Return the depth to which a robot's lighter parts sink in [m]."""
        return SINKS * self.sink

    def cover(self, geom: mujoco.MjsGeom) -> None:
        """Give a geom of the world this surface."""
        geom.friction[:] = [self.friction, TORSIONAL_FRICTION, self.rolling_friction]
        if self.rolling_friction:
            geom.condim = 6
        if self.sink:
            # A contact of a body of mass m has four edges of a friction pyramid, each with the
            # force d k r / R at depth r, where R = 2 μ² (1 + μ²) (1 - d) / (d m), with impedance
            # d and stiffness k (MuJoCo, Computation, Constraint model). The damping is critical.
            d, square = SOFT_IMPEDANCE, self.friction**2
            k = 0.5 * square * (1.0 + square) * (1.0 - d) * GRAVITY / (d * d * self.sink * POINTS)
            geom.solimp[:] = [d, d, 0.001, 0.5, 2.0]
            geom.solref[:] = [1.0 / (d * math.sqrt(k)), 1.0]


AROUND_X, AROUND_Y = (grid.ravel() for grid in np.meshgrid(*[np.linspace(-1.0, 1.0, 5)] * 2))
BASE = 0.1  # m of a field under its lowest point


@dataclass(frozen=True, kw_only=True)
class Slope:
    """A plane through the origin that rises along +x."""

    angle: float = 0.0
    """[rad]"""
    is_plane = True

    @property
    def is_level(self) -> bool:
        """Return whether it is a level plane."""
        return self.angle == 0.0

    def normal(self, x: Array, _y: Array, _reach: float, /) -> Array:
        """Compute the upward normals (..., 3) at places x, y [m]."""
        up = np.array([-math.sin(self.angle), 0.0, math.cos(self.angle)])
        return np.broadcast_to(up, (*np.shape(x), 3))

    def height(self, x: Array, _y: Array, /) -> Array:
        """Compute the height [m] at places x, y [m], all of one shape."""
        return math.tan(self.angle) * x

    def pave(self, spec: mujoco.MjSpec, surface: Surface) -> mujoco.MjsGeom:
        """Add it to a model."""
        geom = add_ground(spec)
        geom.quat[:] = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -self.angle)
        surface.cover(geom)
        return geom


FLAT = Slope()


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightField:
    """Heights at the crossings of a square grid, centered at the origin, with flat triangles
    between them."""

    heights: Array
    """[m], rows along +y and columns along +x, (R, C)."""
    cell: float
    """Distance between two crossings [m]."""
    is_plane = is_level = False

    def __post_init__(self) -> None:
        if self.heights.ndim != 2 or min(self.heights.shape) < 2:
            raise ValueError(
                f"heights are {' by '.join(map(str, self.heights.shape))}, expected 2 by 2 or more"
            )
        if np.ptp(self.heights) == 0.0:
            raise ValueError("heights are all the same, expected different ones: use a plane")

    def normal(self, x: Array, y: Array, reach: float, /) -> Array:
        """Compute the upward normals (..., 3) at places x, y [m], averaged over a reach [m]."""
        rise_x = self.height(x + reach, y) - self.height(x - reach, y)
        rise_y = self.height(x, y + reach) - self.height(x, y - reach)
        normal = np.stack([-rise_x, -rise_y, np.full_like(rise_x, 2.0 * reach)], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def height(self, x: Array, y: Array, /) -> Array:
        """Compute the height [m] at places x, y [m], all of one shape; beyond the edge, its own."""
        rows, columns = self.heights.shape
        across = np.clip(x / self.cell + 0.5 * (columns - 1), 0.0, columns - 1.0)
        along = np.clip(y / self.cell + 0.5 * (rows - 1), 0.0, rows - 1.0)
        c = np.minimum(across.astype(int), columns - 2)
        r = np.minimum(along.astype(int), rows - 2)
        u, v = across - c, along - r
        h = self.heights
        low, high = h[r, c], h[r + 1, c + 1]
        # Each cell is two triangles, which share the diagonal of growing x and y.
        right = low + u * (h[r, c + 1] - low) + v * (high - h[r, c + 1])
        left = low + v * (h[r + 1, c] - low) + u * (high - h[r + 1, c])
        return np.where(u >= v, right, left)

    def pave(self, spec: mujoco.MjSpec, surface: Surface) -> mujoco.MjsGeom:
        """Add it to a model."""
        rows, columns = self.heights.shape
        half = 0.5 * self.cell * np.array([columns - 1, rows - 1])
        field = spec.add_hfield(name=GROUND, nrow=rows, ncol=columns)
        field.size[:] = [*half, np.ptp(self.heights), BASE]
        field.userdata = self.heights.ravel()
        geom = add_world_geom(spec, GROUND, surface.friction)
        geom.type = mujoco.mjtGeom.mjGEOM_HFIELD
        geom.hfieldname = GROUND
        geom.pos[2] = self.heights.min()
        surface.cover(geom)
        return geom


Ground = Slope | HeightField
"""A surface that has one height at every place."""


def mean_height(ground: Ground, x: Array, y: Array, reach: float) -> Array:
    """Compute the mean height [m] of the square around places x, y [m], (N,), within a reach [m].

    It is the mean of 5 by 5 points.
    """
    if ground.is_level:
        return np.zeros(len(x))
    around = (x[:, np.newaxis] + reach * AROUND_X, y[:, np.newaxis] + reach * AROUND_Y)
    return ground.height(*around).mean(axis=1)
