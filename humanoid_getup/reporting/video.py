"""Videos: a motion at its own speed, as MP4 or as GIF."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from humanoid_getup.reporting.film_strip import iterate_frames
from robots import Robot
from robots.quaternion import Array
from robots.storage.files import atomic_path

if TYPE_CHECKING:
    from PIL.Image import Image

RATE, GIF_RATE = 30, 15  # pictures a second
SIZE, GIF_SIZE = (720, 720), (360, 360)  # pixels
GIF = ".gif"
# In software, a picture takes a fifth of the time without multisampling and with small shadows.
SHADOW = 1024  # pixels


def save_video(robot: Robot, model: mujoco.MjModel, time: Array, qpos: Array, path: Path) -> None:
    """Save states (T, nq) at times (T,) [s] as a video, in the format that its suffix names.

    Raises:
        ModuleNotFoundError: if the package ``av``, of the extra ``studio``, is missing for MP4.
        NoRendererError: if OpenGL cannot be opened.
        OSError: if the file cannot be written.
    """
    is_gif = path.suffix.lower() == GIF
    rate, size = (GIF_RATE, GIF_SIZE) if is_gif else (RATE, SIZE)
    at = np.arange(time[0], time[-1] + 0.5 / rate, 1.0 / rate)
    rows = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)
    model = copy.copy(model)
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 0, SHADOW
    frames = iterate_frames(robot, model, qpos[rows], size=size)
    with atomic_path(path) as partial:
        (_write_gif if is_gif else _write_mp4)(frames, rate, size, partial)


def _write_mp4(frames: Iterable[np.ndarray], rate: int, size: tuple[int, int], path: Path) -> None:
    import av

    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=rate, options={"crf": "20"})
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        file.mux(stream.encode(None))


def _write_gif(frames: Iterable[np.ndarray], rate: int, _: tuple[int, int], path: Path) -> None:
    from PIL import Image

    images: list[Image] = [Image.fromarray(frame) for frame in frames]
    first, *others = images
    pause = round(1000.0 / rate)
    first.save(path, "GIF", save_all=True, append_images=others, duration=pause, loop=0)
