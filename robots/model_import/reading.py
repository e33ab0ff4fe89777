"""Model files: MJCF or URDF, distinguished by their root element."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from robots.model_import.mjcf import read_mjcf
from robots.model_import.source import ModelImportError, ModelSource
from robots.model_import.urdf import read_urdf
from robots.storage.files import describe, read_bounded
from robots.storage.model_files import MAX_MODEL


def read_model(path: Path) -> ModelSource:
    """Read a model file.

    Raises:
        ModelImportError: if it cannot be read, is neither MJCF nor URDF, or does not compile.
    """
    try:
        root = ET.fromstring(read_bounded(path, MAX_MODEL))
    except ET.ParseError as error:
        raise ModelImportError([f"{path}: not XML ({error})"]) from error
    except (OSError, ValueError, LookupError) as error:  # the last of an unknown encoding
        reason = f"{describe(error)}, expected an MJCF or URDF file"
        raise ModelImportError([f"{path}: {reason}"]) from error
    if root.tag == "robot":
        return read_urdf(path, root)
    if root.tag == "mujoco":
        return read_mjcf(path)
    raise ModelImportError(
        [f"{path}: its root is <{root.tag}>, expected <mujoco> (MJCF) or <robot> (URDF)"]
    )
