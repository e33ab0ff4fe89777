"""A set of settled falls in a file: drawing a thousand takes minutes, reading them none."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from humanoid_getup.lying import CLASSES, Fall
from robots import Posture, Robot


def save_falls(file: Path, falls: list[Fall]) -> None:
    """Write falls to an .npz file: position, orientation, joint_pos, start_class."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".part.npz")
    np.savez_compressed(
        partial,
        position=np.array([fall.posture.position for fall in falls]),
        orientation=np.array([fall.posture.orientation for fall in falls]),
        joint_pos=np.array([fall.posture.joint_pos for fall in falls]),
        start_class=np.array([fall.start_class for fall in falls]),
    )
    partial.replace(file)


def load_falls(file: Path, robot: Robot) -> list[Fall]:
    """Read falls.

    Raises:
        OSError: if the file cannot be read.
        ValueError: if it holds no falls of this robot.
    """
    try:
        with np.load(file) as stored:
            position, orientation, joint_pos, kinds = (
                stored[name] for name in ("position", "orientation", "joint_pos", "start_class")
            )
    except (KeyError, ValueError, EOFError) as error:
        raise ValueError(f"{file} is no set of falls: {error}") from error
    if joint_pos.ndim != 2 or joint_pos.shape[1] != robot.n or not set(kinds) <= set(CLASSES):
        raise ValueError(
            f"{file} is no set of falls of robot '{robot.name}': joint_pos has shape "
            f"{joint_pos.shape}, allowed (falls, {robot.n})"
        )
    rows = zip(position, orientation, joint_pos, kinds, strict=True)
    return [
        Fall(
            posture=Posture(position=p, orientation=q, joint_pos=v),
            start_class=str(kind),
        )
        for p, q, v, kind in rows
    ]
