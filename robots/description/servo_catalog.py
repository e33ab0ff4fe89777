"""Servo types by name: the package's, and those that a robot's folder brings."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomlkit

from robots.servo import ServoModel
from robots.storage.files import write_atomically
from robots.storage.validation import load_toml, read_table, shown

SERVOS_FILE = "servos.toml"
FIGURES = tuple(field.name for field in fields(ServoModel) if field.name != "name")
"""Keys of a type's table; its name is the table's title."""
_DEFAULTS = {field.name: field.default for field in fields(ServoModel)}


@cache
def servo_models() -> Mapping[str, ServoModel]:
    """Load the servo types that the package knows, by name."""
    return {name: ServoModel(name=name, **figures) for name, figures in _package_table().items()}


def read_servo_models(folder: Path) -> tuple[Mapping[str, ServoModel], list[str]]:
    """Read the servo types of a robot: those of the package and of its own servos.toml.

    A type of the folder that the package knows gives only what differs. Return the types, and all
    problems of the file.
    """
    file = folder / SERVOS_FILE
    if not file.exists():
        return servo_models(), []
    try:
        tables = load_toml(file)
    except ValueError as error:
        return servo_models(), [f"{SERVOS_FILE} {error}"]
    problems: list[str] = []
    own = {name: _read_model(name, table, problems) for name, table in tables.items()}
    return {**servo_models(), **own}, problems


def _read_model(name: str, table: Any, problems: list[str]) -> ServoModel:
    """Read one type on top of the package's figures; a wrong value is replaced by a blank."""
    place = f"{SERVOS_FILE}: {shown(name)}"
    if not isinstance(table, dict):
        problems.append(f"{place} is {shown(table)}, expected a table of figures")
        table = {}
    problems += [
        f"{place}: unknown key {shown(key)}, expected {', '.join(FIGURES)}"
        for key in table
        if key not in FIGURES
    ]
    figures = {**_package_table().get(name, {}), **table, "name": name}
    found = len(problems)
    model = read_table(ServoModel, figures, f"{place}: ", problems)
    if len(problems) == found and model.min_voltage > model.max_voltage:
        problems.append(
            f"{place}: min_voltage is {model.min_voltage:g} V, "
            f"expected at most max_voltage, {model.max_voltage:g} V"
        )
    if len(problems) == found and not model.top_speed > 0.0:
        problems.append(
            f"{place}: friction takes all of the motor's torque, {model.stall_torque:g} N·m: "
            "expected less"
        )
    return model


def write_servo_model(folder: Path, model: ServoModel, about: Sequence[str]) -> None:
    """Write a servo type into a robot's servos.toml, with comments; other types stay."""
    file = folder / SERVOS_FILE
    document = tomlkit.parse(file.read_text("utf-8")) if file.exists() else tomlkit.document()
    known = _package_table().get(model.name, {})
    table = tomlkit.table()
    for line in about:
        table.add(tomlkit.comment(line))
    for key in FIGURES:
        value = getattr(model, key)
        if value is not None and value != known.get(key, _DEFAULTS.get(key)):
            table.add(key, float(f"{value:.5g}") if isinstance(value, float) else value)
    document[model.name] = table
    write_atomically(file, document.as_string())


@cache
def _package_table() -> Mapping[str, Mapping[str, Any]]:
    return tomllib.loads(files("robots").joinpath(SERVOS_FILE).read_text("utf-8"))
