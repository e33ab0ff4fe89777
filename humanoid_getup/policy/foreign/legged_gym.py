"""Descriptions in the configuration of legged_gym and its descendants.

It is a Python file of nested classes. It is parsed and never run: only plain values count.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.policy.action import ActionMode
from humanoid_getup.policy.foreign.config_file import ConfigTable, load_config
from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    ForeignTerm,
    Given,
    NetworkShape,
)
from humanoid_getup.policy.foreign.terms import make_term
from robots.quaternion import Array

Table = dict[str, Any]
LAYOUT = (
    ("base_ang_vel", "ang_vel"),
    ("projected_gravity", None),
    ("commands", None),
    ("dof_pos", "dof_pos"),
    ("dof_vel", "dof_vel"),
    ("actions", None),
)
"""Terms of its observation, and the names of their scales; the code of a task may differ."""
COMMANDS = 3  # of a velocity: forward, left, turning
MOST_DEPTH = 20  # classes that inherit from each other, or lie within each other


def read_legged_gym(files: Sequence[Path], shape: NetworkShape, given: Given) -> ForeignPolicy:
    """Read the configuration class in Python files, the base classes in any of them.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    table = ConfigTable(_find_config(files), files[0].name)
    start, control = table.table("init_state"), table.table("control")
    angles = start.table("default_joint_angles")
    joints = given.joints or tuple(map(str, angles.values))
    default = np.array([angles.number(joint) for joint in joints])
    if control.get("control_type", "P") != "P":
        raise ForeignPolicyError(
            f"{control.name('control_type')} is {control.get('control_type')!r:.20}, expected 'P'"
        )
    k = shape.action
    _check_size(shape, k, len(joints))
    sim = table.table("sim")
    normalization = table.table("normalization")
    gain = np.full(len(joints), given.gain) if given.gain else _match(control, "stiffness", joints)
    return ForeignPolicy(
        format=ForeignFormat.LEGGED_GYM,
        joints=joints,
        moved=joints[:k],
        default_pos=default,
        mode=ActionMode.ABSOLUTE,
        scale=np.full(k, control.number("action_scale")),
        offset=default[:k],
        action_limit=normalization.positive("clip_actions"),
        position_gain=gain,
        damping=_match(control, "damping", joints),
        rate=given.rate or 1.0 / (sim.positive("dt") * control.positive("decimation")),
        observation=_make_terms(normalization, len(joints), k),
        sources={
            "joints": "--joints" if given.joints else f"assumed: {angles.name('*')} in their order",
            "default_pos": start.name("default_joint_angles"),
            "action": control.name("action_scale")
            + (f"; assumed: it moves the first {k} joints" if k < len(joints) else ""),
            "position_gain": "--gain" if given.gain else control.name("stiffness"),
            "damping": control.name("damping"),
            "rate": "--rate" if given.rate else f"{sim.name('dt')} and control.decimation",
            "observation": "assumed: legged_gym's order, scales of "
            + normalization.name("obs_scales"),
        },
    )


def _check_size(shape: NetworkShape, k: int, n: int) -> None:
    """Refuse a network whose observation is not legged_gym's without the base's velocity."""
    plain = 3 + 3 + COMMANDS + 2 * n + k
    if shape.observation == plain + 3:
        raise ForeignPolicyError(
            f"its network takes {plain + 3} numbers, as legged_gym's do with the linear velocity "
            "of the base, which the robot does not measure: train a policy without it"
        )
    if shape.observation != plain:
        raise ForeignPolicyError(
            f"its network takes {shape.observation} numbers, expected {plain} for {n} joints and "
            f"{k} actions: {', '.join(name for name, _ in LAYOUT)}; for another layout, add "
            "metadata as mjlab does"
        )


def _make_terms(normalization: ConfigTable, joints: int, k: int) -> tuple[ForeignTerm, ...]:
    """Make the terms; legged_gym clips them after the scale."""
    scales = normalization.table("obs_scales")
    limit = normalization.positive("clip_observations")
    sizes = dict(
        zip((name for name, _ in LAYOUT), (3, 3, COMMANDS, joints, joints, k), strict=True)
    )
    terms = []
    for name, key in LAYOUT:
        scale = 1.0 if key is None else scales.positive(key)
        terms.append(
            make_term(name, sizes[name], scale=scale, clip=(-limit / scale, limit / scale))
        )
    return tuple(terms)


def _match(control: ConfigTable, key: str, joints: tuple[str, ...]) -> Array:
    """Read numbers whose names are parts of the joints' names; the last that fits counts."""
    rules = control.table(key)
    found = np.full(len(joints), np.nan)
    for part in rules.values:
        found[[str(part) in joint for joint in joints]] = rules.number(part)
    if np.isnan(found).any():
        lacking = ", ".join(np.array(joints)[np.isnan(found)])
        raise ForeignPolicyError(f"{control.name(key)} is missing for {lacking}")
    return found


def _find_config(files: Sequence[Path]) -> Table:
    """Find the one class that no other inherits from and that describes a robot."""
    classes: dict[str, ast.ClassDef] = {}
    for file in files:
        tree = load_config(file, "Python", _parse)
        classes |= {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    inherited = {base for node in classes.values() for base in _list_bases(node)}
    known: dict[int, Table] = {}
    tables = {name: _read_class(node, classes, known) for name, node in classes.items()}
    found = [
        name
        for name, table in tables.items()
        if name not in inherited and {"control", "init_state"} <= table.keys()
    ]
    if len(found) != 1:
        raise ForeignPolicyError(
            f"{files[0].name} has {', '.join(found) or 'no class'}, expected one class with "
            "init_state and control"
        )
    missing = sorted({"normalization", "sim"} - tables[found[0]].keys())
    if missing:
        bases = ", ".join(_list_bases(classes[found[0]])) or "no class"
        raise ForeignPolicyError(
            f"{files[0].name} has no {' and no '.join(missing)}: {found[0]} inherits them from "
            f"{bases}; add the file of that class: --config {files[0].name},FILE"
        )
    return tables[found[0]]


def _parse(text: str) -> ast.Module:
    try:
        return ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"it is not Python: {error}") from error


def _list_bases(node: ast.ClassDef) -> list[str]:
    return [ast.unparse(base).split(".")[-1] for base in node.bases]


def _read_class(
    node: ast.ClassDef,
    classes: dict[str, ast.ClassDef],
    known: dict[int, Table],
    depth: int = 0,
) -> Table:
    """Read the values of a class and of those that it inherits from, and the classes within.

    Each class is read once: ``known`` has those that were.
    """
    if id(node) in known:
        return known[id(node)]
    if depth > MOST_DEPTH:
        raise ForeignPolicyError(f"class {node.name} is nested too deep")
    table: Table = {}
    for base in _list_bases(node):
        if base in classes and classes[base] is not node:
            table |= _read_class(classes[base], classes, known, depth + 1)
    for each in node.body:
        if isinstance(each, ast.ClassDef):
            inner = _read_class(each, {}, known, depth + 1)
            earlier = table.get(each.name)
            keeps = isinstance(earlier, dict) and bool(each.bases)
            table[each.name] = _merge(earlier, inner) if keeps else inner
        elif isinstance(each, ast.Assign) and isinstance(each.targets[0], ast.Name):
            table[each.targets[0].id] = _evaluate(each.value)
    known[id(node)] = table
    return table


def _merge(earlier: Any, own: Table) -> Table:
    """Add the values of a class to those of the class that it inherits from."""
    return {**earlier, **own}


def _evaluate(node: ast.expr) -> Any:
    try:
        return ast.literal_eval(node)
    except (ValueError, TypeError, RecursionError, MemoryError):
        return None  # an expression: of no use here
