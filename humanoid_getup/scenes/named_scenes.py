"""Named scenes: those of [Lin12], section 5.2, rough ground and a wall."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanoid_getup.scenes.scene import Scene
from humanoid_getup.scenes.scene_file import (
    GroundTable,
    SceneTable,
    build_scene,
    read_scene,
    read_scene_table,
)
from robots import Robot
from robots.storage.validation import shown

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
    """Load a scene by name, or from a TOML file.

    Args:
        name: Such as flat, slope:10, rough:easy or my_scene.toml.
        robot: Whose legs give the unit of its sizes.
        seed: Of rough ground.

    Raises:
        ValueError: if there is no such scene, or its file is wrong.
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
