"""Descriptions in the env.yaml that Isaac Lab writes beside a training."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.policy.action import ActionMode
from humanoid_getup.policy.foreign.config_file import ConfigTable, is_number, load_yaml
from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    ForeignTerm,
    Given,
    NetworkShape,
)
from humanoid_getup.policy.foreign.terms import check_terms, find_size, make_term
from robots.quaternion import Array

MODES = {
    "JointPositionAction": ActionMode.ABSOLUTE,
    "RelativeJointPositionAction": ActionMode.OFFSET,
}
GROUPS = ("policy", "actor")  # names of the observation group that the network sees
SETTINGS = (
    *("concatenate_terms", "concatenate_dim", "enable_corruption"),
    *("history_length", "flatten_history_dim"),
)
ALL_JOINTS = (None, [".*"], ".*")
MOST_WAYS = 1_000_000  # in which a pattern may match a name; all are tried within about 10 ms


def read_isaac_env(file: Path, shape: NetworkShape, given: Given) -> ForeignPolicy:
    """Read an env.yaml; the order of the joints is given, as it has none.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    table = ConfigTable(load_yaml(file), file.name)
    joints = given.joints
    if not joints:
        raise ForeignPolicyError(
            f"{file.name} does not state the order of the joints: expected their names in the "
            "simulator's order with --joints NAME,..."
        )
    robot = table.table("scene").table("robot")
    start = robot.table("init_state")
    default = _match(start, "joint_pos", start.require("joint_pos"), joints, missing=0.0)
    action = _find_action(table.table("actions"))
    moved = _find_moved(action, joints)
    group = _find_group(table.table("observations"))
    lower, upper = _read_limits(action, moved)
    damping = _read_actuators(robot.table("actuators"), "damping", joints)
    gain = np.full(len(joints), given.gain) if given.gain else None
    if gain is None:
        gain = _read_actuators(robot.table("actuators"), "stiffness", joints)
    sim = table.table("sim")
    return ForeignPolicy(
        format=ForeignFormat.ISAAC,
        joints=joints,
        moved=moved,
        default_pos=default,
        mode=MODES[_last_word(action.require("class_type"))],
        scale=_match(action, "scale", action.get("scale", 1.0), moved, missing=1.0),
        offset=_read_offset(action, joints, moved, default),
        lower=lower,
        upper=upper,
        position_gain=gain,
        damping=damping,
        rate=given.rate or 1.0 / (sim.positive("dt") * table.positive("decimation")),
        observation=_read_terms(group, len(joints), shape.action),
        sources={
            "joints": "--joints",
            "default_pos": start.name("joint_pos"),
            "action": f"{action.name('class_type')}, scale, offset",
            "position_gain": "--gain" if given.gain else robot.name("actuators.*.stiffness"),
            "damping": robot.name("actuators.*.damping"),
            "rate": "--rate" if given.rate else f"{sim.name('dt')} and decimation",
            "observation": table.name("observations"),
        },
    )


def _find_action(actions: ConfigTable) -> ConfigTable:
    """Return the one action that moves joints to positions."""
    used = [name for name, value in actions.values.items() if isinstance(value, Mapping)]
    kinds = {name: _last_word(actions.table(name).get("class_type", "")) for name in used}
    if len(used) != 1 or kinds[used[0]] not in MODES:
        found = ", ".join(f"{name} ({kind})" for name, kind in kinds.items()) or "none"
        raise ForeignPolicyError(
            f"{actions.name('*')}: {found}, expected one action, {' or '.join(MODES)}"
        )
    return actions.table(used[0])


def _find_moved(action: ConfigTable, joints: tuple[str, ...]) -> tuple[str, ...]:
    patterns = action.texts("joint_names", [".*"])
    if action.get("preserve_order", False):  # that of the patterns
        found = [joint for p in patterns for joint in joints if _fits(p, joint)]
        moved = tuple(dict.fromkeys(found))
    else:
        moved = tuple(joint for joint in joints if any(_fits(p, joint) for p in patterns))
    if not moved:
        raise ForeignPolicyError(f"{action.name('joint_names')} fits none of --joints")
    return moved


def _read_offset(
    action: ConfigTable, joints: tuple[str, ...], moved: tuple[str, ...], default: Array
) -> Array:
    if action.get("use_default_offset", True):
        return default[[joints.index(joint) for joint in moved]]
    return _match(action, "offset", action.get("offset", 0.0), moved, missing=0.0)


def _read_limits(action: ConfigTable, moved: tuple[str, ...]) -> tuple[Array | None, Array | None]:
    """Read the limits of targets, two numbers by patterns of joint names."""
    if action.get("clip") is None:
        return None, None
    lower, upper = np.full((2, len(moved)), [[-np.inf], [np.inf]])
    for pattern, limits in action.table("clip").values.items():
        if not isinstance(limits, list) or len(limits) != 2 or not all(map(is_number, limits)):
            raise ForeignPolicyError(
                f"{action.name('clip')} is {limits!r:.40}, expected two numbers a joint"
            )
        rows = [_fits(pattern, joint) for joint in moved]
        lower[rows], upper[rows] = limits
    return lower, upper


def _read_actuators(actuators: ConfigTable, key: str, joints: tuple[str, ...]) -> Array:
    """Read a figure of the groups of actuators; each joint is in one."""
    found = np.full(len(joints), np.nan)
    for name in actuators.values:
        group = actuators.table(name)
        patterns = group.texts("joint_names_expr")
        rows = [i for i, joint in enumerate(joints) if any(_fits(p, joint) for p in patterns)]
        value = group.require(key)
        own = tuple(joints[i] for i in rows)
        found[rows] = _match(group, key, value, own, missing=np.nan)
    if np.isnan(found).any():
        lacking = ", ".join(np.array(joints)[np.isnan(found)])
        raise ForeignPolicyError(f"{actuators.name('*')}.{key} is missing for {lacking}")
    return found


def _match(
    table: ConfigTable, key: str, value: Any, joints: tuple[str, ...], *, missing: float
) -> Array:
    """Read one number for all joints, or numbers by patterns of their names."""
    rules = value if isinstance(value, Mapping) else {".*": value}
    found = np.full(len(joints), missing)
    for pattern, number in rules.items():
        if not is_number(number):
            raise ForeignPolicyError(f"{table.name(key)} is {number!r:.40}, expected numbers")
        found[[_fits(pattern, joint) for joint in joints]] = number
    return found


def _fits(pattern: Any, joint: str) -> bool:
    """Match a name, unless that could take without end, as by `(j+)+x`.

    Each choice at most doubles the ways to match, and each repeat has a way for each length, if
    it is of no group. In verbose patterns, blanks or a comment may precede it.
    """
    text = str(pattern)
    repeats, choices = len(re.findall("[*+?{]", text[:200])), text[:200].count("|")
    ways = 2**choices * (len(joint) + 1) ** repeats
    if len(text) > 200 or re.search(r"\)[*+{\s#]", text) or ways > MOST_WAYS:
        raise ForeignPolicyError(
            f"pattern '{text:.40}' could take too long to match '{joint:.40}', expected no "
            "repeated groups, and fewer of * + ? and |, such as .*_(hip|knee)_.*"
        )
    try:
        return re.fullmatch(text, joint) is not None
    except (re.error, OverflowError, ValueError) as error:
        raise ForeignPolicyError(f"pattern '{text}' is malformed: {error}") from None


def _find_group(observations: ConfigTable) -> ConfigTable:
    for name in GROUPS:
        if isinstance(observations.values.get(name), Mapping):
            return observations.table(name)
    raise ForeignPolicyError(f"{observations.name(GROUPS[0])} is missing")


def _read_terms(group: ConfigTable, joints: int, actions: int) -> tuple[ForeignTerm, ...]:
    labels = [
        str(name)
        for name, value in group.values.items()
        if name not in SETTINGS and isinstance(value, Mapping)
    ]
    names = {label: _last_word(group.table(label).require("func")) for label in labels}
    check_terms(list(names.values()))
    history = group.get("history_length", 0)
    terms = []
    for label, name in names.items():
        term = group.table(label)
        _check_whole(term)
        terms.append(
            make_term(
                name,
                find_size(name, joints, actions) or 3,
                scale=term.get("scale"),
                clip=term.get("clip"),
                history=history or term.get("history_length", 0),
                is_offset=name != "joint_pos",
                label=label,
            )
        )
    return tuple(terms)


def _check_whole(term: ConfigTable) -> None:
    """Refuse a term of some joints only."""
    parameters = term.get("params", {})
    config = parameters.get("asset_cfg") if isinstance(parameters, Mapping) else None
    names = config.get("joint_names") if isinstance(config, Mapping) else None
    if names not in ALL_JOINTS:
        raise ForeignPolicyError(
            f"{term.name('params')} has joint_names {names!r:.40}, expected all joints"
        )


def _last_word(function: Any) -> str:
    """Return the name of a function or class from `module:name`."""
    return re.split(r"[:.]", str(function))[-1]
