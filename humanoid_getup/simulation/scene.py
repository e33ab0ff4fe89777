"""Where the robot lies: the ground and the obstacles around it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robots import Robot
from robots.quaternion import Array

GROUND = "ground"
SOLREF = (0.004, 1.0)  # as the robots' own geoms, so that friction alone differs
PICTURE = (1920, 1440)  # largest off-screen picture, pixels


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
            raise ValueError(f"obstacle '{self.name}': radius is {self.radius} m, allowed > 0")

    def distance(self, point: Array) -> float:
        """Compute the distance of a point (3,) from the segment [m]."""
        along = self.end - self.start
        share = (point - self.start) @ along / max(float(along @ along), 1e-12)
        return float(np.linalg.norm(point - self.start - np.clip(share, 0.0, 1.0) * along))


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A place to get up in."""

    name: str
    friction: float = 0.8
    """Sliding friction of the ground and the obstacles, whatever touches them."""
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        if not self.friction > 0.0:
            raise ValueError(f"scene '{self.name}': friction is {self.friction}, allowed > 0")

    def build(self, robot: Robot) -> mujoco.MjSpec:
        """Put the robot's model into this place."""
        spec = robot.spec()
        _light(spec)
        _add_ground(spec, self.friction)
        for obstacle in self.obstacles:
            _add_obstacle(spec, obstacle, self.friction)
        return spec

    def compile(self, robot: Robot) -> mujoco.MjModel:
        """Compile the robot in this place."""
        return self.build(robot).compile()


SCENES = {"flat": Scene(name="flat")}


def load_scene(name: str) -> Scene:
    """Load a scene by name.

    Raises:
        ValueError: if there is no such scene.
    """
    if name not in SCENES:
        raise ValueError(f"unknown scene '{name}': allowed {', '.join(sorted(SCENES))}")
    return SCENES[name]


def _add_world_geom(spec: mujoco.MjSpec, name: str, friction: float) -> mujoco.MjsGeom:
    geom = spec.worldbody.add_geom(name=name)
    # MuJoCo takes the larger friction of two geoms unless one has priority;
    # a slippery floor must be slippery under every sole.
    geom.priority = 1
    geom.friction[0] = friction
    geom.solref[:2] = SOLREF
    return geom


def _add_ground(spec: mujoco.MjSpec, friction: float) -> None:
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
    geom = _add_world_geom(spec, GROUND, friction)
    geom.type = mujoco.mjtGeom.mjGEOM_PLANE
    geom.size[:] = [0, 0, 0.05]
    geom.material = GROUND
    geom.rgba[:] = 1.0


def _add_obstacle(spec: mujoco.MjSpec, obstacle: Obstacle, friction: float) -> None:
    geom = _add_world_geom(spec, obstacle.name, friction)
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
