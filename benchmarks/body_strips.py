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

import humanoid_getup as hg
from humanoid_getup.reporting import film_strip
from robots.quaternion import Array

BODIES = ("", "shoulders=2.0", "arms=1.6", "arms=1.6,torso=2.2")
FRAMES = film_strip.COLUMNS  # of each rise
FALLS = 5  # that each body may try, with consecutive seeds
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
        qpos = _get_up(world, start, seed, name)
        if qpos is None:
            continue
        period, view = world.robot.control_period, VIEW / world.robot.standing_neck_height
        rows = film_strip.pick_frames(len(qpos), FRAMES)
        pictures += list(film_strip.render_frames(world.robot, world.model, qpos[rows], view=view))
        captions += [name, *(f"{row * period:.1f} s" for row in rows[1:])]
    if not pictures:
        raise SystemExit("nothing to draw: no body stood")
    film_strip.save_sheet(np.array(pictures), captions, out)


def _get_up(world: hg.World, start: str, seed: int, name: str) -> Array | None:
    """Return the states (T, nq) of a rise, from the first fall from which the robot stands."""
    for number in range(seed, seed + FALLS):
        fall = hg.sample_fall(world, start, number)
        with hg.Twin(world, fall.posture) as twin:
            result = hg.get_up(twin, hg.PlannedRise(world), seed=number, max_attempts=1)
        print(f"{name}, seed {number}: {result}")
        if result.stood and result.outcome is not None:
            end = result.outcome.stand.start_time + film_strip.AFTERMATH
            return result.outcome.qpos[: round(end / world.robot.control_period)]
    return None


if __name__ == "__main__":
    tyro.cli(draw)
