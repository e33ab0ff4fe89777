"""Model files: MJCF or URDF, distinguished by their root element."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

from robots.model_import.mjcf import read_mjcf
from robots.model_import.source import ModelImportError, ModelSource
from robots.model_import.urdf import read_urdf
from robots.storage.files import describe, read_bounded
from robots.storage.model_files import MAX_MODEL, parse_xml
from robots.storage.validation import shown


def read_model(path: Path) -> ModelSource:
    """Read a model file.

    Raises:
        ModelImportError: if it cannot be read, is neither MJCF nor URDF, or does not compile.
    """
    try:
        root = parse_xml(read_bounded(path, MAX_MODEL))
    except (OSError, ValueError) as error:
        reason = describe(error)
        if ", expected " not in reason:
            reason += ", expected an MJCF or URDF file"
        raise ModelImportError([f"{path}: {reason}"]) from error
    if problem := _find_kind_problem(path, root):
        raise ModelImportError([f"{path}: {problem}"])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)  # as MuJoCo's are
        source = read_urdf(path, root) if root.tag == "robot" else read_mjcf(path)
    texts = [" ".join(str(warning.message).split()) for warning in caught]
    if not texts:
        return source
    count = "once" if len(texts) == 1 else f"{len(texts)} times, first"
    return replace(source, notes=(*source.notes, f"MuJoCo warns {count}: {texts[0]}"))


def _find_kind_problem(path: Path, root: ET.Element) -> str | None:
    """Describe why a file is of an unknown kind; None if its kind is known."""
    if root.tag not in ("robot", "mujoco"):
        return f"its root is <{root.tag}>, expected <mujoco> (MJCF) or <robot> (URDF)"
    if any("xacro" in str(element.tag).partition("}")[0] for element in root.iter()):
        return f"it is a xacro source, expected the URDF made of it: xacro {path.name} > robot.urdf"
    if root.tag == "mujoco" and path.suffix not in (".xml", ".urdf"):  # as MuJoCo demands
        return f"an MJCF file that ends in {shown(path.suffix)}, expected .xml: rename it"
    return None
