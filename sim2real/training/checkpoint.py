"""Checkpoints: written whole or not at all, and read with a clear word where they are spoiled."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import torch

from robots.validation import shown
from sim2real.training.ppo import AVERAGE, UPDATES

CHECKPOINT = "checkpoint.pt"
"""Name of the file in a training's folder."""


class CheckpointError(ValueError):
    """A file is no checkpoint of a training; the message is one line."""


def write_checkpoint(state: dict[str, Any], file: Path) -> None:
    """Write a checkpoint in place of the last."""
    partial = file.with_suffix(".part")
    torch.save(state, partial)
    partial.replace(file)


def read_checkpoint(file: Path, device: str = "cpu") -> dict[str, Any]:
    """Read a checkpoint.

    Raises:
        OSError: if the file cannot be read.
        CheckpointError: if it is not whole, or no checkpoint.
    """
    content = BytesIO(file.read_bytes())
    try:
        # What a training writes holds more than tensors; it is the user's own file.
        state = torch.load(content, weights_only=False, map_location=device)
    except Exception as error:  # torch tells a spoiled file in many ways
        told = " ".join(str(error).split())
        raise CheckpointError(f"{file} is no whole checkpoint: {told}") from error
    needed = {"actor_state_dict", AVERAGE, UPDATES, "iter"}
    if not isinstance(state, dict) or not needed <= state.keys():
        raise CheckpointError(f"{file} is no checkpoint of a training: {shown(state)}")
    return state
