"""Model files: MJCF or URDF, distinguished by their root element."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

from robots.model_import.mjcf import read_mjcf
from robots.model_import.source import ModelImportError, ModelSource
from robots.model_import.urdf import read_urdf
from robots.storage.files import describe, read_bounded
from robots.storage.model_files import MAX_MODEL, parse_xml


def read_model(path: Path) -> ModelSource:
    """Read a model file.

    Raises:
        ModelImportError: if it cannot be read, is neither MJCF nor URDF, or does not compile.
    """
    try:
        root = parse_xml(read_bounded(path, MAX_MODEL))
    except (OSError, ValueError) as error:
        reason = f"{describe(error)}, expected an MJCF or URDF file"
        raise ModelImportError([f"{path}: {reason}"]) from error
    if root.tag not in ("robot", "mujoco"):
        raise ModelImportError(
            [f"{path}: its root is <{root.tag}>, expected <mujoco> (MJCF) or <robot> (URDF)"]
        )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)  # as MuJoCo's are
        source = read_urdf(path, root) if root.tag == "robot" else read_mjcf(path)
    texts = [" ".join(str(warning.message).split()) for warning in caught]
    note = [f"MuJoCo warns {len(texts)} times, first: {texts[0]}"] if texts else []
    return replace(source, notes=(*source.notes, *note))
