"""Draw how a robot gets up with other bodies: a row of pictures for each, to one scale.

Each body lies as a fall of its own left it, the first of a few from which it stands, and gets up
by a plan of its own.

    python benchmarks/body_strips.py --start prone --seed 0 --out bodies.png
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from strips import get_up

import humanoid_getup as hg
from humanoid_getup.reporting import film_strip

BODIES = ("", "shoulders=2.0", "arms=1.6", "arms=1.6,torso=2.2")
FRAMES = film_strip.COLUMNS  # of each rise
VIEW = 0.95  # m, the height of a picture


def draw(
    robot: str = "op3",
    bodies: tuple[str, ...] = BODIES,
    start: Literal["supine", "prone", "left", "right"] = "prone",
    seed: int = 0,
    out: Path = Path("bodies.png"),
) -> None:
    """Get up once with each body, and draw the rises below each other.

    Args:
        robot: Name or folder of a robot.
        bodies: Factors on the lengths of its parts; "" for its own body.
        start: Class of the falls.
        seed: Of the first fall and its plan.
        out: PNG file.
    """
    pictures: list[np.ndarray] = []
    captions: list[str] = []
    for text in bodies:
        name, world = text or "original", hg.World(hg.load_robot(robot, hg.Body.parse(text)))
        qpos = get_up(world, start, seed, name)
        if qpos is None:
            continue
        period, view = world.robot.control_period, VIEW / world.robot.standing_neck_height
        rows = film_strip.pick_frames(len(qpos), FRAMES)
        pictures += list(film_strip.render_frames(world.robot, world.model, qpos[rows], view=view))
        captions += [name, *(f"{row * period:.1f} s" for row in rows[1:])]
    if not pictures:
        raise SystemExit("nothing to draw: no body stood")
    film_strip.save_sheet(np.array(pictures), captions, out)


if __name__ == "__main__":
    tyro.cli(draw)
