"""Draw how a robot gets up in each scene: a row of pictures for each, by a plan of its own.

python benchmarks/scene_strips.py --seed 0 --out scene_strips.png
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tyro
from rise_in_scenes import SCENES
from strips import get_up

import humanoid_getup as hg
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.named_scenes import load_scene

FRAMES = film_strip.COLUMNS  # of each rise
VIEW = 2.4  # height of a picture over the robot's standing neck height
AZIMUTH = 130.0  # deg


def draw(
    robot: str = "op3",
    scenes: tuple[str, ...] = SCENES,
    seed: int = 0,
    out: Path = Path("scene_strips.png"),
) -> None:
    """Get up once in each scene, from where robots lie in it, and draw the rises.

    Args:
        robot: Name or folder of a robot.
        scenes: Names or files of scenes.
        seed: Of rough ground, and of the first fall and its plan.
        out: PNG file.
    """
    pictures: list[np.ndarray] = []
    captions: list[str] = []
    body = hg.load_robot(robot)
    for name in scenes:
        scene = load_scene(name, body, seed)
        start = next((str(s.start_class) for s in scene.starts), "supine")
        world = hg.World(body, scene)
        qpos = get_up(world, start, seed, name)
        if qpos is None:
            continue
        rows = film_strip.pick_frames(len(qpos), FRAMES)
        drawn = film_strip.render_frames(body, world.model, qpos[rows], azimuth=AZIMUTH, view=VIEW)
        pictures += list(drawn)
        captions += [name, *(f"{row * body.control_period:.1f} s" for row in rows[1:])]
    if not pictures:
        raise SystemExit("nothing to draw: the robot stood in no scene")
    film_strip.save_sheet(np.array(pictures), captions, out)


if __name__ == "__main__":
    tyro.cli(draw)
