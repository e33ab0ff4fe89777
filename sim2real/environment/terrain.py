"""The terrain of a training: flat, rough and sloping patches in one field, easy ones first.

The patches are made like the scenes rough:easy to rough:hard and slope:10 to slope:30.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from humanoid_getup.scenes.ground import HeightField
from humanoid_getup.scenes.named_scenes import ROUGHNESS, TILE
from humanoid_getup.scenes.scene import Scene, StartRegion
from robots import Robot
from robots.body.parts import leg_length
from robots.quaternion import Array

LEVELS = ("flat", *ROUGHNESS)
SLOPES = {"easy": 10.0, "medium": 20.0, "hard": 30.0}  # degrees
TILES = 16  # on each side of a patch
MARGIN = 4  # tiles around a patch on which no robot starts


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A square of the terrain of one kind."""

    name: str
    level: int
    """Row in `LEVELS`."""
    region: StartRegion
    """Region in which robots fall on it."""


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """The scene of a training, and its patches."""

    scene: Scene
    patches: tuple[Patch, ...]

    @property
    def flat_center(self) -> Array:
        """Return the middle of the flat patch [m], (2,)."""
        region = self.patches[0].region
        return 0.5 * np.array([region.x[0] + region.x[1], region.y[0] + region.y[1]])


def build_terrain(robot: Robot, rng: np.random.Generator) -> Terrain:
    """Build the terrain for a robot: the flat patch, and a rough and a sloping one per level."""
    unit = leg_length(robot)
    cell = unit * TILE
    kinds: list[tuple[str, int, Array]] = [("flat", 0, np.zeros((TILES + 1, TILES + 1)))]
    for level, name in enumerate(LEVELS[1:], start=1):
        rough = rng.uniform(-1.0, 1.0, (TILES + 1, TILES + 1)) * ROUGHNESS[name] * unit
        rise = math.tan(math.radians(SLOPES[name])) * cell * np.arange(TILES + 1)
        slope = np.tile(rise - rise.mean(), (TILES + 1, 1))
        kinds += [(f"rough:{name}", level, rough), (f"slope:{SLOPES[name]:g}", level, slope)]
    heights = np.concatenate([heights for _, _, heights in kinds])  # patches along +y
    middle = 0.5 * (len(heights) - 1)
    half = (0.5 * TILES - MARGIN) * cell
    patches = []
    for row, (name, level, _) in enumerate(kinds):
        y = (row * (TILES + 1) + 0.5 * TILES - middle) * cell
        region = StartRegion(x=(-half, half), y=(y - half, y + half), margin=0.5 * MARGIN * cell)
        patches.append(Patch(name=name, level=level, region=region))
    ground = HeightField(heights=heights, cell=cell)
    return Terrain(scene=Scene(name="terrain", ground=ground), patches=tuple(patches))
