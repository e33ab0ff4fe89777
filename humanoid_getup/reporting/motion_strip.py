"""Film strips of a stored motion, and of keys with the rollout of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.reporting import film_strip
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import lowest_point, place
from robots.quaternion import Array

if TYPE_CHECKING:  # it optimizes, and is slow to import
    from humanoid_getup.motions.trial import Trial


def draw_motion(
    robot: Robot, motion: Motion, path: Path, *, scene: Scene = FLAT_SCENE, title: str = ""
) -> None:
    """Draw a motion as a film strip into a PNG file."""
    pictures, times = _render(World(robot, scene), motion, film_strip.FRAMES)
    path.parent.mkdir(parents=True, exist_ok=True)
    title = title or f"{motion.name}: {motion.strategy}"
    film_strip.save_strip(pictures, times, path, title=title)


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureRow:
    """A row of postures, one after the other."""

    name: str
    qpos: Array
    """MuJoCo positions on flat ground, (K, nq)."""


def draw_motions(
    robot: Robot, motions: Sequence[Motion], path: Path, rows: Sequence[PostureRow] = ()
) -> None:
    """Draw motions into one PNG file, a row each, and rows of postures below them."""
    pictures, captions = list[np.ndarray](), list[str]()

    def add(frames: np.ndarray, shown: list[str]) -> None:
        blank = [np.full_like(frames[:1], 255)] * (film_strip.COLUMNS - len(frames))
        pictures.extend([frames, *blank])
        captions.extend([*shown, *[""] * len(blank)])

    world = World(robot, FLAT_SCENE)
    for motion in motions:
        frames, times = _render(world, motion, film_strip.COLUMNS)
        add(frames, [motion.name, *(f"{time:.1f} s" for time in times[1:])])
    for row in rows:
        chosen = film_strip.pick_frames(len(row.qpos), film_strip.COLUMNS)
        frames = film_strip.render_frames(robot, world.model, row.qpos[chosen])
        add(frames, [row.name, *(f"{k}" for k in chosen[1:])])
    path.parent.mkdir(parents=True, exist_ok=True)
    film_strip.save_sheet(np.concatenate(pictures), captions, path, title=f"{robot.name}: motions")


def _render(world: World, motion: Motion, frames: int) -> tuple[np.ndarray, Array]:
    """Render frames until a motion stands; return pictures and their times [s]."""
    robot, model = world.robot, world.model
    # All frames where it is not known when it stands.
    stands = motion.duration if motion.stand_time is None else motion.stand_time
    end = motion.time[0] + stands + film_strip.AFTERMATH
    count = int(np.searchsorted(motion.time, min(end, motion.time[-1]), side="right"))
    rows = film_strip.pick_frames(count, frames)
    qpos = np.array([place(robot, model, motion.posture(int(row))) for row in rows])
    return film_strip.render_frames(robot, model, qpos), motion.time[rows] - motion.time[0]


def draw_trial(trial: Trial, path: Path) -> None:
    """Draw each key upright on the ground, then the rollout, as a PNG file."""
    robot, model, keyframes = trial.world.robot, trial.world.model, trial.keyframes
    times = np.concatenate([[0.0], np.cumsum(keyframes.duration)])
    keys = np.array([_stand_up(trial, key) for key in keyframes.keys])
    end = float(trial.stand.start_time) + film_strip.AFTERMATH if trial.rises else np.inf
    qpos = trial.outcome.qpos
    rows = film_strip.pick_frames(int(np.fmin(end / trial.outcome.record.period, len(qpos))))
    pictures = np.concatenate(
        [
            film_strip.render_frames(robot, model, keys),
            film_strip.render_frames(robot, model, qpos[rows]),
        ]
    )
    captions = [f"key {k + 1}: {time:.2f} s" for k, time in enumerate(times)]
    captions += [f"{(row + 1) * trial.outcome.record.period:.1f} s" for row in rows]
    ending = "ends as it should" if trial.succeeded else "fails"
    title = f"{keyframes.name}: its keys without physics, then played: {ending}"
    film_strip.save_sheet(pictures, captions, path, title=title)


def _stand_up(trial: Trial, joint_pos: Array) -> Array:
    """Place joint angles with the torso as in the stance, the lowest point on the ground."""
    robot, model = trial.world.robot, trial.world.model
    posture = Posture(
        position=np.zeros(3), orientation=robot.standing.orientation, joint_pos=joint_pos
    )
    qpos = place(robot, model, posture)
    qpos[robot.layout(model).root_qpos + 2] -= lowest_point(model, qpos)
    return qpos
