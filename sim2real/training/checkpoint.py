"""Checkpoints: written atomically, and read without running code from the file."""

from __future__ import annotations

import copy
import zipfile
from dataclasses import fields, is_dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict

from robots.storage.files import atomic_path, read_bounded
from robots.storage.validation import shown
from sim2real.training.ppo import AVERAGE, UPDATES

CHECKPOINT = "checkpoint.pt"
"""Name of the file in a training's folder."""
MAX_BYTES = 2**30
"""Limit for a checkpoint, packed and unpacked; those of 512 robots have some megabytes."""


def write_checkpoint(state: dict[str, Any], file: Path) -> None:
    """Replace the checkpoint; it holds tensors, numbers, texts and containers only."""
    with atomic_path(file) as partial:
        torch.save(_to_plain(state), partial)


def read_checkpoint(file: Path, device: str = "cpu") -> dict[str, Any]:
    """Read a checkpoint; arrays and dataclasses come back as tensors and dictionaries.

    Raises ValueError if it is incomplete, too large, none, or holds Python objects.
    """
    try:
        content = BytesIO(read_bounded(file, MAX_BYTES))
        _check_unpacked_size(content)
        state = torch.load(content, weights_only=True, map_location=device)
    except OSError:
        raise
    except Exception as error:  # torch reports a damaged file in many ways
        if "weights_only" in str(error) or "Unsupported" in str(error):
            raise ValueError(
                f"{file} holds Python objects, expected tensors and numbers only: it was made "
                "by an earlier version or by someone else; train again"
            ) from error
        reason = " ".join(str(error).split())
        raise ValueError(f"{file} is not a complete checkpoint: {reason}") from error
    needed = {"actor_state_dict", AVERAGE, UPDATES, "iter"}
    if not isinstance(state, dict) or not needed <= state.keys():
        raise ValueError(f"{file} is not a checkpoint of a training: {shown(state)}")
    return state


def _check_unpacked_size(content: BytesIO) -> None:
    """Refuse an archive that torch would unpack to more than the limit of a checkpoint."""
    if zipfile.is_zipfile(content):
        size = sum(entry.file_size for entry in zipfile.ZipFile(content).infolist())
        if size > MAX_BYTES:
            raise ValueError(f"it unpacks to {size} bytes, expected at most {MAX_BYTES}")
    content.seek(0)


def restore_like(template: Any, stored: Any) -> Any:
    """Convert content of a checkpoint to the types of a template with the same structure."""
    if is_dataclass(template) and not isinstance(template, type):
        values = restore_like(_fields_of(template), stored)
        restored = copy.copy(template)
        for name, value in values.items():
            object.__setattr__(restored, name, value)
        return restored
    if isinstance(template, dict):
        if not isinstance(stored, dict) or stored.keys() != template.keys():
            raise ValueError(
                f"the checkpoint holds {shown(stored)}, expected {', '.join(map(str, template))}"
            )
        return {key: restore_like(value, stored[key]) for key, value in template.items()}
    if isinstance(template, np.ndarray):
        if not isinstance(stored, torch.Tensor) or tuple(stored.shape) != template.shape:
            raise ValueError(
                f"the checkpoint holds {shown(stored)}, expected an array {template.shape}"
            )
        return stored.cpu().numpy().astype(template.dtype)
    return stored


def _to_plain(value: Any) -> Any:
    """Replace arrays by tensors, and dataclasses by dictionaries."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(np.array(value))
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, TensorDict):
        return value.to_dict()
    if isinstance(value, dict):
        return {key: _to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(map(_to_plain, value))
    if is_dataclass(value) and not isinstance(value, type):
        return _to_plain(_fields_of(value))
    return value


def _fields_of(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}
