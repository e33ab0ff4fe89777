"""`getup scenes`: list the scenes, and draw where robots lie in them."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from humanoid_getup.cli.options.motions import ListScenes
from humanoid_getup.cli.shared.console import console_for, make_table, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.experiments.starts.falls import CLASSES, sample_falls
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.output_files import find_file_problems
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.named_scenes import list_scenes as list_named
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place

VIEW = 3.2  # height of a picture over the robot's standing neck height
AZIMUTH = 130.0  # deg


class SceneRow(msgspec.Struct, frozen=True, kw_only=True):
    """A scene in the list."""

    name: str
    about: str
    starts: list[str]
    obstacles: int
    friction: float


def list_scenes(command: ListScenes) -> int:
    """Print a table or JSON of the scenes, and draw one or all if a picture is asked for."""
    with refusing():
        robot = load_robot(command)
        about = {scene.name: scene.about for scene in list_named()}
        names = [command.scene] if command.scene else list(about)
        scenes = [load_scene(name, robot, command.seed) for name in names]
    rows = [
        _describe(scene, about.get(name, scene.about))
        for name, scene in zip(names, scenes, strict=True)
    ]
    if command.picture is not None:
        _draw(robot, scenes, command.picture, command.seed)
    write_json({"robot": robot.name, "scenes": rows}, command)
    if command.json is None:
        _print(rows)
    return DID_IT


def _describe(scene: Scene, about: str) -> SceneRow:
    starts = list(dict.fromkeys(str(start.start_class) for start in scene.starts))
    return SceneRow(
        name=scene.name,
        about=about,
        starts=starts or list(CLASSES),
        obstacles=len(scene.obstacles),
        friction=scene.surface.friction,
    )


def _print(rows: list[SceneRow]) -> None:
    texts = ("scene", "starts", "about")
    table = make_table((*texts, "obstacles", "friction"), left=texts)
    for row in rows:
        starts = "any" if row.starts == list(CLASSES) else ", ".join(row.starts)
        table.add_row(row.name, starts, row.about, str(row.obstacles), f"{row.friction:g}")
    console_for().print(table)


def _draw(robot: Robot, scenes: list[Scene], file: Path, seed: int) -> None:
    """Draw a robot that lies in each scene; in a single scene, in every way of lying."""
    if problems := find_file_problems(file):
        raise BadInputError("; ".join(problems))
    pictures, captions = [], []
    with phase("drawing") as report:
        for scene in scenes:
            report(f"drawing {scene.name}")
            world = World(robot, scene)
            classes = list(dict.fromkeys(str(s.start_class) for s in scene.starts)) or ["prone"]
            chosen = classes if len(scenes) == 1 else classes[:1]
            with refusing():
                falls = sample_falls(world, dict.fromkeys(chosen, 1), np.random.default_rng(seed))
            qpos = np.array([place(robot, world.model, fall.posture) for fall in falls])
            try:
                drawn = film_strip.render_frames(
                    robot, world.model, qpos, azimuth=AZIMUTH, view=VIEW
                )
            except film_strip.NoRendererError as error:
                raise BadInputError(str(error)) from error
            pictures += list(drawn)
            captions += [f"{scene.name}, {fall.start_class}" for fall in falls]
        film_strip.save_sheet(np.array(pictures), captions, file)
