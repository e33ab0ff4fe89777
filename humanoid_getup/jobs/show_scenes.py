"""Describes scenes, and draws where robots lie in them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.experiments.starts.falls import CLASSES, sample_falls
from humanoid_getup.jobs.requests.style import ScenesRequest
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.named_scenes import list_scenes, load_scene
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place

VIEW = 3.2  # height of a picture over the robot's standing neck height
AZIMUTH = 130.0  # deg


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


def show_scenes(
    request: ScenesRequest, report: Report | None = None, cancel: Cancel | None = None
) -> dict[str, Any]:
    """Describe one scene or all that have a name, and draw them if a picture is requested."""
    ScenesRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    with refusing():
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
        with refusing():
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
