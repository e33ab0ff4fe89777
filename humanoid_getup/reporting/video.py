"""Videos: a motion at its own speed, as MP4, GIF or WebP."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from itertools import chain
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

RATE, LOOP_RATE = 30, 20  # pictures a second; GIF counts in hundredths of a second
SIZE, LOOP_SIZE = (720, 720), (360, 360)  # pixels
LOOPS = {".gif": "GIF", ".webp": "WEBP"}
"""Formats of pictures that play again and again, by suffix."""
# In software, a picture takes a fifth of the time without multisampling and with small shadows.
SHADOW = 1024  # pixels


def save_video(robot: Robot, model: mujoco.MjModel, time: Array, qpos: Array, path: Path) -> None:
    """Save states (T, nq) at times (T,) [s] as a video, in the format that its suffix names."""
    rate, size = find_rate(path), LOOP_SIZE if _is_loop(path) else SIZE
    at = np.arange(time[0], time[-1] + 0.5 / rate, 1.0 / rate)
    rows = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)
    model = copy.copy(model)
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 0, SHADOW
    write_video(iterate_frames(robot, model, qpos[rows], size=size), rate, path)


def find_rate(path: Path) -> int:
    """Return the pictures a second of a video in the format that its suffix names."""
    return LOOP_RATE if _is_loop(path) else RATE


def write_video(frames: Iterable[np.ndarray], rate: int, path: Path) -> None:
    """Write pictures (height, width, 3) of one size, even for MP4, as a video."""
    with atomic_path(path) as partial:
        if _is_loop(path):
            _write_loop(frames, rate, partial, LOOPS[path.suffix.lower()])
        else:
            _write_mp4(frames, rate, partial)


def _is_loop(path: Path) -> bool:
    return path.suffix.lower() in LOOPS


def _write_mp4(frames: Iterable[np.ndarray], rate: int, path: Path) -> None:
    import av

    frames = iter(frames)
    first = next(frames)
    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=rate, options={"crf": "20"})
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        for frame in chain([first], frames):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        file.mux(stream.encode(None))


def _write_loop(frames: Iterable[np.ndarray], rate: int, path: Path, kind: str) -> None:
    from PIL import Image

    images: list[Image] = [Image.fromarray(frame) for frame in frames]
    first, *others = images
    pause = round(1000.0 / rate)
    first.save(path, kind, save_all=True, append_images=others, duration=pause, loop=0)
