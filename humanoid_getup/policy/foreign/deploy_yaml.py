"""Descriptions in the deploy.yaml of Unitree's projects.

Joints are numbered as the simulator orders them; ``joint_ids_map`` gives their numbers in the
order of the motors. Gains are in the order of the motors, postures and scales in the simulator's.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.policy.action import ActionMode
from humanoid_getup.policy.foreign.config_file import ConfigTable, load_yaml
from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    ForeignTerm,
    Given,
    NetworkShape,
    spread,
)
from humanoid_getup.policy.foreign.terms import check_terms, find_size, make_term
from robots.quaternion import Array

ACTION = "JointPositionAction"


def read_deploy_yaml(file: Path, shape: NetworkShape, given: Given) -> ForeignPolicy:
    """Read a deploy.yaml; the names of the motors' joints are given, as it has none.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    table = ConfigTable(load_yaml(file), file.name)
    order = _read_order(table)
    n, motors = len(order), max(order) + 1
    if len(given.joints) < motors:
        given_names = f"--joints has {len(given.joints)}" if given.joints else "it names no joints"
        raise ForeignPolicyError(
            f"{file.name}: {given_names}, expected {motors} names in the order of the motors with "
            "--joints NAME,..."
        )
    joints = tuple(given.joints[motor] for motor in order)
    actions = table.table("actions")
    if list(actions.values) != [ACTION]:
        raise ForeignPolicyError(
            f"{table.name('actions')} has {', '.join(map(str, actions.values))}, expected {ACTION}"
        )
    action = actions.table(ACTION)
    moved = _read_moved(action, joints)
    default = spread(table.require("default_joint_pos"), n, table.name("default_joint_pos"))
    limits = _read_limits(action, len(moved))
    gain = np.full(n, given.gain) if given.gain else _read_motors(table, "stiffness", order)
    return ForeignPolicy(
        format=ForeignFormat.UNITREE,
        joints=joints,
        moved=moved,
        default_pos=default,
        mode=ActionMode.ABSOLUTE,
        scale=spread(action.get("scale", 1.0), len(moved), action.name("scale")),
        offset=spread(action.get("offset", 0.0), len(moved), action.name("offset")),
        lower=limits[0],
        upper=limits[1],
        position_gain=gain,
        damping=_read_motors(table, "damping", order),
        rate=given.rate or 1.0 / table.positive("step_dt"),
        observation=_read_terms(table.table("observations"), n, shape.action),
        sources={
            "joints": f"--joints, ordered by {table.name('joint_ids_map')}",
            "default_pos": table.name("default_joint_pos"),
            "action": f"{action.name('scale')}, offset, clip",
            "position_gain": "--gain" if given.gain else table.name("stiffness"),
            "damping": table.name("damping"),
            "rate": "--rate" if given.rate else table.name("step_dt"),
            "observation": table.name("observations"),
        },
    )


def _read_order(table: ConfigTable) -> list[int]:
    found = table.require("joint_ids_map")
    is_list = isinstance(found, list) and found and all(type(number) is int for number in found)
    if not is_list or len(set(found)) < len(found) or not 0 <= min(found) <= max(found) < 1000:
        raise ForeignPolicyError(
            f"{table.name('joint_ids_map')} is {found!r:.40}, expected each motor's number once"
        )
    return found


def _read_motors(table: ConfigTable, key: str, order: list[int]) -> Array:
    """Read a figure of the motors into the policy's order."""
    name, values = table.name(key), table.require(key)
    size = len(values) if isinstance(values, list) else 0
    if size <= max(order):
        raise ForeignPolicyError(f"{name} has {size} numbers, expected {max(order) + 1}")
    return spread(values, size, name)[order]


def _read_moved(action: ConfigTable, joints: tuple[str, ...]) -> tuple[str, ...]:
    numbers = action.get("joint_ids")
    if numbers is None or numbers == [None] * 3:  # all of them: a slice of Python
        return joints
    if not isinstance(numbers, list) or not all(number in range(len(joints)) for number in numbers):
        raise ForeignPolicyError(
            f"{action.name('joint_ids')} is {numbers!r:.40}, expected numbers of joints"
        )
    return tuple(joints[number] for number in numbers)


def _read_limits(action: ConfigTable, size: int) -> tuple[Array | None, Array | None]:
    clip = action.get("clip")
    if clip is None:
        return None, None
    try:
        pairs = np.asarray(clip, dtype=float).reshape(size, 2)
    except (TypeError, ValueError, OverflowError):
        raise ForeignPolicyError(
            f"{action.name('clip')} is {clip!r:.40}, expected two numbers a joint"
        ) from None
    return pairs[:, 0], pairs[:, 1]


def _read_terms(table: ConfigTable, joints: int, actions: int) -> tuple[ForeignTerm, ...]:
    names = [str(name) for name in table.values]
    check_terms(names)
    return tuple(_read_term(table.table(name), name, joints, actions) for name in names)


def _read_term(term: ConfigTable, name: str, joints: int, actions: int) -> ForeignTerm:
    scale: Any = term.get("scale")
    size = len(scale) if isinstance(scale, list) else None
    return make_term(
        name,
        size or find_size(name, joints, actions) or 1,
        scale=scale,
        clip=term.get("clip"),
        history=term.get("history_length", 1),
        is_offset=name != "joint_pos",
    )
