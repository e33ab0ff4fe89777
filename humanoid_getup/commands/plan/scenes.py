"""`getup scenes`: the scenes, and pictures of robots that lie in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import find_json_target, make_table
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import READ, WRITTEN
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.options import BodyOption, RobotOption, Seed
from humanoid_getup.experiments.falls import CLASSES, sample_falls
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.named_scenes import list_scenes, load_scene
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place

VIEW = 3.2  # height of a picture over the robot's standing neck height
AZIMUTH = 130.0  # deg


@dataclass(frozen=True, kw_only=True)
class ScenesRequest(BodyOption, RobotOption):
    """List the scenes in which a robot may lie, or draw them."""

    scene: Annotated[Positional[str], READ] = ""
    """Name of a scene, or a scene file (.toml); default: all named scenes."""
    seed: Seed = 0
    picture: Annotated[Path | None, WRITTEN, arg(metavar="FILE.png")] = None
    """Picture to write of a robot that lies in each scene; of one scene alone, in each of its
    ways."""


@command("scenes", json=True)
def show_scenes(request: ScenesRequest, monitor: ProgressMonitor) -> dict[str, Any]:
    """Describe one scene or all that have a name, and draw them if a picture is requested."""
    robot = load_robot(request)
    about = {scene.name: scene.about for scene in list_scenes()}
    names = [request.scene] if request.scene else list(about)
    scenes = [load_scene(name, robot, request.seed) for name in names]
    if request.picture is not None:
        _draw(robot, scenes, request.picture, request.seed, monitor)
    rows = [
        _describe(scene, about.get(name, scene.about))
        for name, scene in zip(names, scenes, strict=True)
    ]
    return {"robot": robot.name, "scenes": rows}


def _describe(scene: Scene, about: str) -> dict[str, Any]:
    """Describe a scene with the ways of lying in it."""
    starts = tuple(dict.fromkeys(str(start.start_class) for start in scene.starts))
    return {
        "name": scene.name,
        "about": about,
        "starts": starts or tuple(CLASSES),
        "obstacles": len(scene.obstacles),
        "friction": scene.surface.friction,
    }


def _draw(
    robot: Robot, scenes: Sequence[Scene], file: Path, seed: int, monitor: ProgressMonitor
) -> None:
    """Draw a robot that lies in each scene; in a single scene, in every way of lying."""
    pictures, captions = [], []
    for scene in scenes:
        monitor.begin(f"drawing {scene.name}")
        world = World(robot, scene)
        classes = list(dict.fromkeys(str(s.start_class) for s in scene.starts)) or ["prone"]
        chosen = classes if len(scenes) == 1 else classes[:1]
        falls = sample_falls(world, dict.fromkeys(chosen, 1), np.random.default_rng(seed))
        qpos = np.array([place(robot, world.model, fall.posture) for fall in falls])
        try:
            drawn = film_strip.render_frames(robot, world.model, qpos, azimuth=AZIMUTH, view=VIEW)
        except film_strip.NoRendererError as error:
            raise BadInputError(str(error)) from error
        pictures += list(drawn)
        captions += [f"{scene.name}, {fall.start_class}" for fall in falls]
    monitor.check()
    film_strip.save_sheet(np.array(pictures), captions, file)


@show_scenes.show
def _print(found: dict[str, Any], request: ScenesRequest, console: Console) -> None:
    if find_json_target(request) is not None:
        return
    texts = ("scene", "starts", "about")
    table = make_table((*texts, "obstacles", "friction"), left=texts)
    for row in found["scenes"]:
        starts = "any" if row["starts"] == tuple(CLASSES) else ", ".join(row["starts"])
        obstacles, friction = str(row["obstacles"]), f"{row['friction']:g}"
        table.add_row(row["name"], starts, row["about"], obstacles, friction)
    console.print(table)
