"""Scenes: the ground and the obstacles around the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from robots import Robot
from robots.ground import GROUND, GROUND_FRICTION, add_ground, add_world_geom
from robots.quaternion import Array

PICTURE = (1920, 1440)  # largest off-screen picture, pixels

GroundHeight = Callable[[Array, Array], Array]
"""Maps x, y [m] in the world to the height of the ground there [m], all of one shape."""


def flat_ground(x: Array, _y: Array) -> Array:
    """Return the height of the plane z = 0."""
    return np.zeros_like(x)


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """A sphere-swept volume: every point within ``radius`` of a line segment."""

    name: str
    start: Array
    """One end of the segment in the world [m], shape (3,)."""
    end: Array
    """Its other end [m], shape (3,); the same point makes a sphere."""
    radius: float
    """[m]"""

    def __post_init__(self) -> None:
        if not self.radius > 0.0:
            raise ValueError(f"obstacle '{self.name}': radius is {self.radius} m, expected > 0")

    def distance(self, point: Array) -> float:
        """Compute the distance of a point (3,) from the segment [m]."""
        along = self.end - self.start
        share = (point - self.start) @ along / max(float(along @ along), 1e-12)
        return float(np.linalg.norm(point - self.start - np.clip(share, 0.0, 1.0) * along))


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Ground and obstacles, and how slippery they are."""

    name: str
    friction: float = GROUND_FRICTION
    """Sliding friction of the ground and the obstacles against any other geom."""
    obstacles: tuple[Obstacle, ...] = ()
    ground: GroundHeight = flat_ground
    """Height of the ground, over which standing is measured."""

    def __post_init__(self) -> None:
        if not self.friction > 0.0:
            raise ValueError(f"scene '{self.name}': friction is {self.friction}, expected > 0")

    def build(self, robot: Robot) -> mujoco.MjSpec:
        """Add this scene to the robot's model."""
        spec = robot.spec()
        _light(spec)
        _pave(spec, self.friction)
        for obstacle in self.obstacles:
            _add_obstacle(spec, obstacle, self.friction)
        return spec

    def compile(self, robot: Robot) -> mujoco.MjModel:
        """Compile the robot in this scene."""
        return self.build(robot).compile()


SCENES = {"flat": Scene(name="flat")}


def load_scene(name: str) -> Scene:
    """Load a scene by name.

    Raises:
        ValueError: if there is no such scene.
    """
    if name not in SCENES:
        raise ValueError(f"unknown scene '{name}': expected {', '.join(sorted(SCENES))}")
    return SCENES[name]


def _pave(spec: mujoco.MjSpec, friction: float) -> None:
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
    geom = add_ground(spec, friction)
    geom.material = GROUND
    geom.rgba[:] = 1.0


def _add_obstacle(spec: mujoco.MjSpec, obstacle: Obstacle, friction: float) -> None:
    geom = add_world_geom(spec, obstacle.name, friction)
    geom.rgba[:] = [0.62, 0.45, 0.30, 1.0]
    geom.size[0] = obstacle.radius
    if np.allclose(obstacle.start, obstacle.end):
        geom.type = mujoco.mjtGeom.mjGEOM_SPHERE
        geom.pos[:] = obstacle.start
    else:
        geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
        geom.fromto[:] = np.concatenate([obstacle.start, obstacle.end])


def _light(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.96, 0.97, 0.98],
        rgb2=[0.78, 0.84, 0.90],
        width=256,
        height=1536,
    )
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
    spec.visual.global_.offwidth, spec.visual.global_.offheight = PICTURE
    spec.stat.extent = 1.0
