"""The recipe beside a checkpoint: written once, and compared before a training goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robots.faults import shown

RECIPE = "recipe.json"
"""Name of the file in a training's folder."""
FREE = ("recipe.iterations",)  # how long, not what: a training may go on for longer


class OtherTrainingError(ValueError):
    """A folder holds another training than the one asked for."""


def settle_recipe(file: Path, asked: dict[str, Any]) -> None:
    """Write down what is trained; where it is written already, see that it is the same.

    Raises:
        OtherTrainingError: telling all that differs.
    """
    if file.exists():
        check_recipe(file, asked)
    partial = file.with_suffix(".part")
    partial.write_text(json.dumps(asked, indent=1) + "\n", "utf-8")
    partial.replace(file)


def check_recipe(file: Path, asked: dict[str, Any]) -> None:
    """See that a recipe file says what is asked for.

    Raises:
        OtherTrainingError: telling all that differs.
    """
    try:
        found = _flatten(json.loads(file.read_text("utf-8")))
    except (ValueError, AttributeError) as error:
        raise OtherTrainingError(f"{file} is no recipe of a training: {error}") from error
    wanted = _flatten(json.loads(json.dumps(asked)))
    differences = [
        f"{key} is {shown(found.get(key))} there, {shown(wanted.get(key))} is asked for"
        for key in sorted(found.keys() | wanted.keys())
        if key not in FREE and found.get(key) != wanted.get(key)
    ]
    if differences:
        told = "; ".join(differences)
        raise OtherTrainingError(f"{file.parent} holds another training: {told}")


def _flatten(record: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn tables within tables into one, its keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in record.items():
        name = f"{prefix}{key}"
        flat |= _flatten(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return flat
