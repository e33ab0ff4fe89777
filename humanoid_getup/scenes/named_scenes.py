"""Named scenes: those of [Lin12], section 5.2, rough ground and a wall."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from humanoid_getup.scenes.ground import FLAT, Ground, HeightField, Slope, Surface
from humanoid_getup.scenes.obstacle import Obstacle, make_capsule
from humanoid_getup.scenes.scene import Scene, StartRegion
from robots import Robot, quaternion
from robots.body.parts import leg_length
from robots.ground import GROUND_FRICTION
from robots.quaternion import Array
from robots.storage.files import readable
from robots.storage.validation import (
    on_axes,
    positive,
    read_toml,
    reading,
    shown,
)

FARTHEST = 100.0  # legs or m
Number = Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST, description="a number from -100 to 100")]
Point = Annotated[tuple[Number, Number, Number], Meta(description="three numbers, x y z")]
Size = Annotated[float, positive(FARTHEST)]
Share = Annotated[float, Meta(ge=0.0, le=10.0, description="a number from 0 to 10")]
Friction = Annotated[float, Meta(ge=0.01, le=10.0, description="a number from 0.01 to 10")]
Degrees = Annotated[float, Meta(ge=-360.0, le=360.0, description="degrees from -360 to 360")]
DegreeRange = Annotated[tuple[Degrees, Degrees], Meta(description="two angles in degrees")]
NumberRange = Annotated[tuple[Number, Number], Meta(description="two numbers")]
SlopeAngle = Annotated[float, Meta(ge=-30.0, le=30.0, description="degrees from -30 to 30")]
MOST_OBSTACLES = 1000


@dataclass(frozen=True, kw_only=True)
class SurfaceTable:
    """A surface in a scene file."""

    friction: Friction = GROUND_FRICTION
    rolling_friction: Share = 0.0
    sink: Share = 0.0

    def at(self, unit: float) -> Surface:
        """Make the surface; ``unit`` is in meters."""
        return Surface(
            friction=self.friction,
            rolling_friction=unit * self.rolling_friction,
            sink=unit * self.sink,
        )


@dataclass(frozen=True, kw_only=True)
class GroundTable(SurfaceTable):
    """The ground in a scene file: a slope in degrees, or heights on a grid."""

    slope_deg: SlopeAngle = 0.0
    heights: Annotated[Array, on_axes(2)] | None = None
    cell: Size = 0.25

    def build(self, unit: float) -> Ground:
        """Make the ground; ``unit`` is in meters."""
        if self.heights is not None:
            if self.slope_deg:
                raise ValueError("ground has slope_deg and heights, expected one of them")
            if (highest := float(np.abs(self.heights).max(initial=0.0))) > FARTHEST:
                raise ValueError(f"heights reach {highest:g}, expected -100 to 100")
            return HeightField(heights=unit * self.heights, cell=unit * self.cell)
        return Slope(angle=math.radians(self.slope_deg)) if self.slope_deg else FLAT


@dataclass(frozen=True, kw_only=True)
class BoxTable(SurfaceTable):
    """A box in a scene file: center, edges, and rotation, first about z."""

    name: str
    center: Point
    size: Annotated[tuple[Size, Size, Size], Meta(description="three numbers above 0")]
    turn_deg: Degrees = 0.0
    tilt_deg: Degrees = 0.0

    def build(self, unit: float) -> Obstacle:
        """Make the obstacle; ``unit`` is in meters."""
        turn = quaternion.from_yaw(math.radians(self.turn_deg))
        tilt = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -math.radians(self.tilt_deg))
        return Obstacle(
            name=self.name,
            kind="box",
            half_size=0.5 * unit * np.array(self.size),
            position=unit * np.array(self.center),
            orientation=quaternion.multiply(turn, tilt),
            surface=self.at(unit),
        )


@dataclass(frozen=True, kw_only=True)
class CapsuleTable(SurfaceTable):
    """A capsule in a scene file: two ends and a radius; a sphere has equal ends."""

    name: str
    start: Point
    end: Point
    radius: Size

    def build(self, unit: float) -> Obstacle:
        """Make the obstacle; ``unit`` is in meters."""
        start, end = unit * np.array(self.start), unit * np.array(self.end)
        return make_capsule(self.name, start, end, unit * self.radius, self.at(unit))


@dataclass(frozen=True, kw_only=True)
class SphereTable(SurfaceTable):
    """A sphere in a scene file."""

    name: str
    center: Point
    radius: Size

    def build(self, unit: float) -> Obstacle:
        """Make the obstacle; ``unit`` is in meters."""
        center = unit * np.array(self.center)
        return make_capsule(self.name, center, center, unit * self.radius, self.at(unit))


@dataclass(frozen=True, kw_only=True)
class StartTable:
    """A start region in a scene file."""

    lying: Literal["supine", "prone", "left", "right"]
    x: NumberRange = (0.0, 0.0)
    y: NumberRange = (0.0, 0.0)
    z: NumberRange = (-FARTHEST, FARTHEST)
    margin: Share = 0.25
    settled: bool = False
    heading_deg: DegreeRange = (-180.0, 180.0)

    def build(self, unit: float) -> StartRegion:
        """Make the region; ``unit`` is in meters."""
        for key in ("x", "y", "z", "heading_deg"):
            low, high = getattr(self, key)
            if low > high:
                raise ValueError(
                    f"start '{self.lying}': {key} is {low:g} to {high:g}, "
                    "expected the lower number first"
                )
            if low == high and key in ("x", "y") and not (self.margin or self.settled):
                raise ValueError(
                    f"start '{self.lying}': {key} is {low:g} alone and margin is 0, expected a "
                    "range or a margin above 0: no robot that falls comes to rest exactly there"
                )
        low, high = self.heading_deg
        return StartRegion(
            start_class=self.lying,
            x=(unit * self.x[0], unit * self.x[1]),
            y=(unit * self.y[0], unit * self.y[1]),
            z=(unit * self.z[0], unit * self.z[1]),
            margin=unit * self.margin,
            is_settled=self.settled,
            heading=(math.radians(low), math.radians(high)),
        )


@dataclass(frozen=True, kw_only=True)
class SceneTable:
    """The content of a scene file."""

    about: str = ""
    """What it is, in one line."""
    unit: Literal["leg", "m"] = "leg"
    ground: GroundTable = field(default_factory=GroundTable)
    boxes: tuple[BoxTable, ...] = ()
    capsules: tuple[CapsuleTable, ...] = ()
    spheres: tuple[SphereTable, ...] = ()
    starts: tuple[StartTable, ...] = ()


def read_scene(file: Path, robot: Robot, name: str | None = None) -> Scene:
    """Read a scene from a TOML file, its sizes for a robot."""
    table = read_scene_table(file)
    with reading(f"scene {file}"):
        return build_scene(table, robot, name or readable(file.stem))


def read_scene_table(file: Path) -> SceneTable:
    """Read a scene file."""
    with reading(f"scene {file}") as problems:
        return read_toml(SceneTable, file, problems)


def build_scene(table: SceneTable, robot: Robot, name: str) -> Scene:
    """Build a scene for a robot."""
    unit = leg_length(robot) if table.unit == "leg" else 1.0
    parts = (*table.boxes, *table.capsules, *table.spheres)
    if len(parts) > MOST_OBSTACLES:
        raise ValueError(f"{len(parts)} obstacles, expected at most {MOST_OBSTACLES}")
    own = {geom.name for geom in robot.spec().geoms}
    if clash := [part.name for part in parts if part.name in own]:
        raise ValueError(
            f"obstacle '{clash[0]}' has the name of a part of robot '{robot.name}', "
            "expected another one"
        )
    _check_starts_on_field(table)
    return Scene(
        name=name,
        about=table.about,
        ground=table.ground.build(unit),
        surface=table.ground.at(unit),
        obstacles=tuple(part.build(unit) for part in parts),
        starts=tuple(start.build(unit) for start in table.starts),
    )


def _check_starts_on_field(table: SceneTable) -> None:
    """Check that robots are dropped on the height field, beyond which there is no ground."""
    if table.ground.heights is None or table.ground.heights.ndim != 2:
        return
    rows, columns = table.ground.heights.shape
    for axis, count in (("x", columns), ("y", rows)):
        edge = 0.5 * (count - 1) * table.ground.cell
        for start in table.starts:
            low, high = getattr(start, axis)
            if max(-low, high) > edge:
                raise ValueError(
                    f"start '{start.lying}': {axis} is {low:g} to {high:g}, expected within "
                    f"the field of heights, -{edge:g} to {edge:g}"
                )


FOLDER = Path(__file__).parent / "named"
STEEPEST = 30.0  # degrees
SLOPE, ROUGH = "slope", "rough"
ROUGHNESS: dict[str, float] = {"easy": 0.05, "medium": 0.10, "hard": 0.20}
"""Largest deviation of a height from the mean, as a share of the leg length."""
# [Frezzato22], section 3.2, perturbs tiles of 1 m for humans, whose legs are 0.9 m long.
TILE = 1.1  # legs
TILES = 16  # on each side of the field
SUFFIX = ".toml"


@dataclass(frozen=True, kw_only=True)
class NamedScene:
    """A scene with a name."""

    name: str
    about: str


def list_scenes() -> list[NamedScene]:
    """List the named scenes; those with a parameter once, with an example."""
    files = sorted(FOLDER.glob(f"*{SUFFIX}"))
    named = [NamedScene(name=f.stem, about=read_scene_table(f).about) for f in files]
    slope = NamedScene(name=f"{SLOPE}:10", about=f"a slope of 10°, or up to {STEEPEST:g}°")
    rough = [
        NamedScene(
            name=f"{ROUGH}:{level}",
            about=f"rough ground, uneven by up to {share:g} leg lengths; its seed is --seed",
        )
        for level, share in ROUGHNESS.items()
    ]
    return [*named, slope, *rough]


def load_scene(name: str, robot: Robot, seed: int = 0) -> Scene:
    """Load a scene by name, such as flat, slope:10 or rough:easy, or from a TOML file.

    The robot's legs give the unit of its sizes; the seed is that of rough ground.
    """
    kind, has_parameter, parameter = name.partition(":")
    if name.endswith(SUFFIX):
        return read_scene(Path(name), robot)
    if kind == SLOPE and has_parameter:
        return build_scene(_slope(parameter), robot, name)
    if kind == ROUGH and has_parameter:
        return build_scene(_roughen(parameter, seed), robot, name)
    file = FOLDER / f"{name}{SUFFIX}"
    if name not in [f.stem for f in FOLDER.glob(f"*{SUFFIX}")]:
        names = ", ".join(scene.name for scene in list_scenes())
        raise ValueError(f"unknown scene {shown(name)}: expected {names} or a .toml file")
    return read_scene(file, robot, name)


def seed_grounds(name: str, count: int, seed: int) -> list[int]:
    """Return the seeds of ``count`` random grounds of a scene; one if its ground is not random.

    No two seeds have a ground in common.
    """
    return [*range(seed * count, (seed + 1) * count)] if is_random(name) else [seed]


def is_random(name: str) -> bool:
    """Return whether the ground of a scene depends on the seed."""
    return name.startswith(f"{ROUGH}:")


def _slope(degrees: str) -> SceneTable:
    try:
        angle = float(degrees)
    except ValueError:
        angle = float("nan")
    if not abs(angle) <= STEEPEST:
        raise ValueError(
            f"scene slope:{degrees}: expected degrees from {-STEEPEST:g} to {STEEPEST:g}"
        )
    return SceneTable(ground=GroundTable(slope_deg=angle))


def _roughen(level: str, seed: int) -> SceneTable:
    if level not in ROUGHNESS:
        raise ValueError(f"scene rough:{level}: expected rough:{', rough:'.join(ROUGHNESS)}")
    rng = np.random.default_rng([seed, *level.encode()])
    heights = rng.uniform(-1.0, 1.0, (TILES + 1, TILES + 1)) * ROUGHNESS[level]
    return SceneTable(ground=GroundTable(heights=heights, cell=TILE))
