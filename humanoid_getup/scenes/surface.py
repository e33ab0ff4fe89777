"""Surfaces: friction and softness of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco

from robots.ground import GROUND_FRICTION

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

    def __post_init__(self) -> None:
        if not self.friction > 0.0:
            raise ValueError(f"friction is {self.friction:g}, expected above 0")
        if not self.rolling_friction >= 0.0:
            raise ValueError(f"rolling friction is {self.rolling_friction:g} m, expected 0 or more")
        if not self.sink >= 0.0:
            raise ValueError(f"sink is {self.sink:g} m, expected 0 or more")

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
