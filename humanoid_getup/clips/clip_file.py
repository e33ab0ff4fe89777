"""Reading of motion capture files by their kind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from humanoid_getup.clips.acclaim import RATE, read_acclaim
from humanoid_getup.clips.bvh import read_bvh
from humanoid_getup.clips.clip import Clip

BVH, ACCLAIM, SKELETON = ".bvh", ".amc", ".asf"


def read_clip(
    file: Path, skeleton: Path | None, rate: float | None, up: Literal["y", "z"] | None
) -> Clip:
    """Read a .bvh or .amc clip; the skeleton of an .amc may be the .asf file beside it.

    Raises:
        OSError: if a file cannot be read.
        ValueError: if it is not a clip.
    """
    if file.suffix.lower() == BVH:
        return replace(read_bvh(file), up=up or "y")
    skeleton = skeleton or file.with_name(f"{file.stem.split('_')[0]}{SKELETON}")
    return replace(read_acclaim(file, skeleton, rate or RATE), up=up or "y")
