"""Film strips: a motion as a row of pictures."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import numpy as np
from matplotlib import pyplot as plt

from robots import Robot
from robots.rotation import Array

FRAME_SIZE = (300, 300)  # pixels, width and height of one picture


class NoRendererError(RuntimeError):
    """No GL is there to render with."""


def render_frames(
    robot: Robot, model: mujoco.MjModel, qpos: Array, *, azimuth: float = 60.0
) -> np.ndarray:
    """Render states (K, nq) with a camera that follows the robot, (K, height, width, 3).

    Raises:
        NoRendererError: if no GL can be opened.
    """
    os.environ.setdefault("MUJOCO_GL", "egl")
    width, height = FRAME_SIZE
    data = mujoco.MjData(model)
    layout = robot.layout(model)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = azimuth, -12.0, 1.05
    pictures = []
    try:
        renderer = mujoco.Renderer(model, height=height, width=width)
    except Exception as error:  # GL back ends raise whatever they like
        raise NoRendererError(f"no GL to render with: {error}") from error
    with renderer:
        for state in qpos:
            data.qpos[:] = state
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            camera.lookat[:] = [*data.xpos[layout.torso][:2], 0.2]
            renderer.update_scene(data, camera)
            pictures.append(renderer.render().copy())
    return np.array(pictures)


def save_strip(pictures: np.ndarray, times: Array, path: Path, *, title: str = "") -> None:
    """Save pictures (K, height, width, 3) taken at ``times`` [s] as one row, as PNG."""
    count = len(pictures)
    figure, axes = plt.subplots(1, count, figsize=(1.6 * count, 2.0), squeeze=False)
    for axis, picture, time in zip(axes[0], pictures, times, strict=True):
        axis.imshow(picture)
        axis.set_axis_off()
        axis.set_title(f"{time:.1f} s", fontsize=8)
    if title:
        figure.suptitle(title, fontsize=9)
    figure.tight_layout(pad=0.2)
    partial = path.with_suffix(".part.png")
    figure.savefig(partial, dpi=110)
    plt.close(figure)
    partial.replace(path)
