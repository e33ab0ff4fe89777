"""Scenes: ground and obstacles around a robot, and its start regions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np

from humanoid_getup.scenes.ground import FLAT, Ground, Surface
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.start_region import StartRegion
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


PICTURE = (1920, 1440)  # largest off-screen picture, pixels


def add_backdrop(spec: mujoco.MjSpec, ground: mujoco.MjsGeom) -> None:
    """Add sky and light to a model, and a pattern to its ground."""
    _add_sky(spec)
    _add_light(spec)
    _add_pattern(spec, ground)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = PICTURE
    spec.stat.extent = 1.0


def _add_pattern(spec: mujoco.MjSpec, ground: mujoco.MjsGeom) -> None:
    spec.add_texture(
        name=GROUND,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.87, 0.89],
        rgb2=[0.78, 0.80, 0.83],
        mark=mujoco.mjtMark.mjMARK_EDGE,
        markrgb=[0.70, 0.72, 0.75],
        width=300,
        height=300,
    )
    material = spec.add_material(name=GROUND, texrepeat=[5, 5], texuniform=True, reflectance=0.05)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = GROUND
    ground.material = GROUND
    ground.rgba[:] = 1.0


def _add_sky(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.96, 0.97, 0.98],
        rgb2=[0.78, 0.84, 0.90],
        width=256,
        height=1536,
    )


def _add_light(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.8, 0.6, 3.0],
        dir=[-0.25, -0.2, -1.0],
        diffuse=[0.55, 0.55, 0.55],
        specular=[0.2, 0.2, 0.2],
    )
    spec.visual.headlight.ambient[:] = 0.38
    spec.visual.headlight.diffuse[:] = 0.30
    spec.visual.headlight.specular[:] = 0.05
    spec.visual.quality.shadowsize = 4096
