"""Scenes: ground and obstacles around a robot, and its start regions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np

from humanoid_getup.scenes.backdrop import add_backdrop
from humanoid_getup.scenes.ground import FLAT, Ground
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.start_region import StartRegion
from humanoid_getup.scenes.surface import Surface
from robots import Robot
from robots.ground import GROUND
from robots.quaternion import Array

FOOTHOLD = 0.01  # m by which a sole may be lower than what it stands on

Support = Callable[[Array], Array]
"""Maps points (..., 3) [m] to the height of the ground or obstacle under each [m], (...)."""


def flat_support(point: Array) -> Array:
    """Return the height of the plane z = 0."""
    return np.zeros(point.shape[:-1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Ground and obstacles, in meters."""

    name: str
    about: str = ""
    """What it is, in one line."""
    ground: Ground = FLAT
    surface: Surface = field(default_factory=Surface)
    """Surface of the ground."""
    obstacles: tuple[Obstacle, ...] = ()
    starts: tuple[StartRegion, ...] = ()
    """Start regions; without any, robots lie at the origin in any direction."""
    is_flat: bool = field(init=False, repr=False)
    """Whether it is the same at every place and in every direction."""
    deepest_sink: float = field(init=False, repr=False)
    """How deep a part of a robot may sink into the softest surface [m]."""

    def __post_init__(self) -> None:
        names = Counter([GROUND, *(obstacle.name for obstacle in self.obstacles)])
        if twice := [name for name, count in names.items() if count > 1]:
            raise ValueError(
                f"two obstacles, or one and the ground, have the name '{twice[0]}', "
                "expected each name once"
            )
        is_flat = self.ground.is_level and not self.obstacles and not self.starts
        surfaces = [self.surface, *(obstacle.surface for obstacle in self.obstacles)]
        object.__setattr__(self, "is_flat", is_flat)
        object.__setattr__(self, "deepest_sink", max(s.deepest_sink for s in surfaces))

    def support(self, point: Array) -> Array:
        """Compute the height of the ground or obstacle under points (..., 3) [m], (...)."""
        x, y, z = np.moveaxis(point, -1, 0)
        height = self.ground.height(x, y)
        for obstacle in self.obstacles:
            top = obstacle.top(x, y)
            is_under = top <= z + FOOTHOLD + obstacle.surface.sink
            height = np.where(is_under, np.maximum(height, top), height)
        return height

    def build(self, robot: Robot) -> mujoco.MjSpec:
        """Add this scene to the robot's model."""
        spec = robot.spec()
        add_backdrop(spec, self.ground.pave(spec, self.surface))
        for obstacle in self.obstacles:
            obstacle.add(spec)
        return spec

    def compile(self, robot: Robot) -> mujoco.MjModel:
        """Compile the robot in this scene."""
        return self.build(robot).compile()


FLAT_SCENE = Scene(name="flat")
