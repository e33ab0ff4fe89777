"""Scenes: ground and obstacles around a robot, and its start regions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import mujoco
import numpy as np

from humanoid_getup.scenes.ground import FLAT, Ground, Slope, Surface
from humanoid_getup.scenes.obstacle import Obstacle
from robots import Posture, Robot, quaternion
from robots.ground import GROUND
from robots.quaternion import Array

Range = tuple[float, float]

SPREAD = math.radians(15.0)  # of the orientation in which a robot is dropped, each axis
WIDENED = np.array([1.0, 1.0, 0.0])  # axes on which a margin counts
DRIFT = math.radians(30.0)  # by which its heading may leave the range while it settles


@dataclass(frozen=True, kw_only=True)
class StartRegion:
    """A region of a scene in which robots lie in one way."""

    start_class: str | None = None
    """supine, prone, left or right; None for any."""
    x: Range = (0.0, 0.0)
    """Range in which the torso is dropped [m]."""
    y: Range = (0.0, 0.0)
    z: Range = (-math.inf, math.inf)
    """Range of the height of the torso, to distinguish under a table from on it [m]."""
    margin: float = 0.0
    """Distance by which the torso may leave the region while the robot settles [m]."""
    is_settled: bool = False
    """Whether robots settle on the bare ground first and are then put in the region, because no
    robot falls there, such as under a table."""
    heading: Range = (-math.pi, math.pi)
    """Horizontal direction in which the head points [rad], 0 along +x."""

    def sample(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw the place [m], (2,), and orientation, (4,), of a dropped robot."""
        if self.start_class is None:
            orientation = quaternion.normalize(rng.normal(size=4))
            return self._draw_place(rng) if self._has_place else np.zeros(2), orientation
        place = self._draw_place(rng)
        heading, spread = rng.uniform(*self.heading), rng.normal(0.0, SPREAD, 3)
        turned = quaternion.multiply(quaternion.from_yaw(heading), lying(self.start_class))
        axis = spread / max(float(np.linalg.norm(spread)), 1e-12)
        shaken = quaternion.from_axis_angle(axis, float(np.linalg.norm(spread)))
        return place, quaternion.normalize(quaternion.multiply(turned, shaken))

    @property
    def _has_place(self) -> bool:
        """Return whether robots lie at another place than the origin."""
        return (*self.x, *self.y) != (0.0, 0.0, 0.0, 0.0)

    def _draw_place(self, rng: np.random.Generator) -> Array:
        return np.array([rng.uniform(*self.x), rng.uniform(*self.y)])

    def move(self, posture: Posture, rng: np.random.Generator) -> Posture:
        """Move a lying robot to a place in the region, with a heading of the region."""
        heading = rng.uniform(*self.heading)
        return lay_at(posture, self._draw_place(rng), heading)

    def spans(self, position: Array) -> bool:
        """Return whether a torso's position [m], (3,), is in the region or its margin."""
        if self.start_class is None and not self._has_place:
            return True
        low, high = np.array([self.x, self.y, self.z]).T
        low, high = low - self.margin * WIDENED, high + self.margin * WIDENED
        return bool(np.all((position >= low) & (position <= high)))

    def accepts(self, posture: Posture, start_class: str) -> bool:
        """Return whether a settled robot lies in the class and the region."""
        if self.start_class is None:
            return True
        low, high = self.heading
        off = math.remainder(_find_heading(posture) - 0.5 * (low + high), 2.0 * math.pi)
        is_there = start_class == self.start_class and self.spans(posture.position)
        return is_there and abs(off) <= 0.5 * (high - low) + DRIFT


ANYWHERE = StartRegion()


def lay_at(posture: Posture, place: Array, heading: float) -> Posture:
    """Move a lying robot to a place (2,) [m], and turn its head to a heading [rad]."""
    turn = quaternion.from_yaw(heading - _find_heading(posture))
    return replace(
        posture,
        position=np.array([*place, posture.position[2]]),
        orientation=quaternion.normalize(quaternion.multiply(turn, posture.orientation)),
    )


def _find_heading(posture: Posture) -> float:
    """Find the horizontal direction in which the head of a lying robot points [rad]."""
    head = quaternion.rotate(posture.orientation, np.array([0.0, 0.0, 1.0]))
    return math.atan2(head[1], head[0])


def lying(start_class: str) -> Array:
    """Return the orientation of a torso that lies in a class, its head along +x, (4,)."""
    down = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.5 * math.pi)  # face down
    turn = {"prone": 0.0, "supine": math.pi, "left": -0.5 * math.pi, "right": 0.5 * math.pi}
    about_spine = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), turn[start_class])
    return quaternion.multiply(down, about_spine)


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

    def __post_init__(self) -> None:
        names = Counter([GROUND, *(obstacle.name for obstacle in self.obstacles)])
        if twice := [name for name, count in names.items() if count > 1]:
            raise ValueError(
                f"two obstacles, or one and the ground, have the name '{twice[0]}', "
                "expected each name once"
            )

    @cached_property
    def is_flat(self) -> bool:
        """Whether it is the same at every place and in every direction."""
        return self.ground.is_level and not self.obstacles and not self.starts

    @cached_property
    def slope(self) -> float:
        """Angle by which a bare plane rises along +x [rad]; 0 in any other scene."""
        if self.obstacles or self.starts or not isinstance(self.ground, Slope):
            return 0.0
        return self.ground.angle

    @cached_property
    def footing(self) -> Array:
        """Orientation of soles that point uphill on a slope, w x y z, (4,)."""
        if not self.slope:
            return quaternion.IDENTITY
        tilt = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -self.slope)
        return quaternion.multiply(tilt, quaternion.from_yaw(0.0 if self.slope > 0.0 else math.pi))

    @property
    def deepest_sink(self) -> float:
        """Return how deep a part of a robot may sink into the softest surface [m]."""
        surfaces = (self.surface, *(obstacle.surface for obstacle in self.obstacles))
        return max(surface.deepest_sink for surface in surfaces)

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
    _light_sky(spec)
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


def _light_sky(spec: mujoco.MjSpec) -> None:
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
