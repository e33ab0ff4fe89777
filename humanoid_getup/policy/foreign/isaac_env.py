"""Descriptions in the env.yaml that Isaac Lab writes beside a training; no code in it is run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from humanoid_getup.policy.action import ActionMode
from humanoid_getup.policy.foreign.description import (
    ForeignNetwork,
    ForeignPolicy,
    ForeignPolicyError,
    ForeignTerm,
    check_terms,
    find_size,
    make_term,
)
from robots.quaternion import Array
from robots.storage.validation import parse_file
from robots.storage.yaml_text import parse_yaml

MODES = {
    "JointPositionAction": ActionMode.ABSOLUTE,
    "RelativeJointPositionAction": ActionMode.OFFSET,
}
GROUPS = ("policy", "actor")  # names of the observation group that the network sees
MOST_WAYS = 1_000_000  # in which a pattern may match a name; all are tried within about 10 ms

Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
Positive = Annotated[float, Meta(gt=0.0, lt=1e6, description="a number above 0")]
Numbers = Annotated[dict[str, Number] | Number, Meta(description="numbers")]
Limits = Annotated[dict[str, tuple[Number, Number]], Meta(description="two numbers a joint")]
Texts = Annotated[tuple[str, ...], Meta(description="texts")]
Text = Annotated[str, Meta(description="a text")]
Choice = Annotated[bool, Meta(description="true or false")]
Table = Annotated[dict[str, Any], Meta(description="a table")]


class Config:
    """Values of a YAML file by the paths of their keys, which messages and sources name."""

    def __init__(self, file: Path) -> None:
        """Read a file; tags of Python objects become the lists or tables that they tag.

        Raises:
            ForeignPolicyError: if it cannot be read, is not YAML, or holds no table.
        """
        try:
            self._values = parse_file(file, "YAML", partial(parse_yaml, keeps_tagged=True))
        except ValueError as error:
            raise ForeignPolicyError(f"{file}: {error}") from error
        if not isinstance(self._values, dict):
            raise ForeignPolicyError(f"{file} holds no table, expected Isaac Lab's env.yaml")
        self._file = file.name

    def name(self, *path: str) -> str:
        """Name a value for people."""
        return f"{self._file} {'.'.join(path)}"

    def get(self, kind: Any, *path: str, default: Any = None) -> Any:
        """Return a value of an annotated type; the default if it is missing or null.

        Raises:
            ForeignPolicyError: if it is missing without a default, or of another type.
        """
        value: Any = self._values
        for depth, key in enumerate(path):
            if not isinstance(value, dict):
                found = f"{self.name(*path[:depth])} is {value!r:.40}"
                raise ForeignPolicyError(f"{found}, expected a table")
            if (value := value.get(key)) is None:
                if default is not None:
                    return default
                raise ForeignPolicyError(f"{self.name(*path[: depth + 1])} is missing")
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError:
            expected = kind.__metadata__[0].description
            raise ForeignPolicyError(
                f"{self.name(*path)} is {value!r:.40}, expected {expected}"
            ) from None


def read_isaac_env(
    file: Path, network: ForeignNetwork, joints: tuple[str, ...], gain: float | None
) -> ForeignPolicy:
    """Read an env.yaml; the order of the joints is given, as it has none.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    config, robot = Config(file), ("scene", "robot")
    if not joints:
        raise ForeignPolicyError(
            f"{file.name} does not state the order of the joints: expected their names in the "
            "simulator's order with --joints NAME,..."
        )
    default = _match(config.get(Numbers, *robot, "init_state", "joint_pos"), joints, missing=0.0)
    action = _find_action(config)
    moved = _find_moved(config, action, joints)
    offset = default[[joints.index(joint) for joint in moved]]
    if not config.get(Choice, *action, "use_default_offset", default=True):
        offset = _match(config.get(Numbers, *action, "offset", default=0.0), moved, missing=0.0)
    step = config.get(Positive, "sim", "dt") * config.get(Positive, "decimation")
    return ForeignPolicy(
        format="isaac",
        joints=joints,
        moved=moved,
        default_pos=default,
        mode=MODES[_last_word(config.get(Text, *action, "class_type"))],
        scale=_match(config.get(Numbers, *action, "scale", default=1.0), moved, missing=1.0),
        offset=offset,
        limits=_read_limits(config.get(Limits, *action, "clip", default={}), moved),
        position_gain=None if gain else _read_motors(config, "stiffness", joints),
        damping=_read_motors(config, "damping", joints),
        rate=1.0 / step,
        observation=_read_terms(config, len(joints), network.action),
        sources={
            "joints": "--joints",
            "default_pos": config.name(*robot, "init_state", "joint_pos"),
            "action": f"{config.name(*action, 'class_type')}, scale, offset",
            "position_gain": config.name(*robot, "actuators", "*", "stiffness"),
            "damping": config.name(*robot, "actuators", "*", "damping"),
            "rate": f"{config.name('sim', 'dt')} and decimation",
            "observation": config.name("observations"),
        },
    )


def _find_action(config: Config) -> tuple[str, str]:
    """Find the one action that moves joints to positions."""
    actions = config.get(Table, "actions")
    kinds = {
        name: _last_word(action.get("class_type", ""))
        for name, action in actions.items()
        if isinstance(action, dict)
    }
    if len(kinds) != 1 or not MODES.keys() & kinds.values():
        found = ", ".join(f"{name} ({kind})" for name, kind in kinds.items()) or "none"
        raise ForeignPolicyError(
            f"{config.name('actions', '*')}: {found}, expected one action, {' or '.join(MODES)}"
        )
    return "actions", next(iter(kinds))


def _find_moved(
    config: Config, action: tuple[str, str], joints: tuple[str, ...]
) -> tuple[str, ...]:
    patterns = config.get(Texts, *action, "joint_names", default=(".*",))
    found = [joint for pattern in patterns for joint in joints if _fits(pattern, joint)]
    if not found:
        raise ForeignPolicyError(f"{config.name(*action, 'joint_names')} fits none of --joints")
    if not config.get(Choice, *action, "preserve_order", default=False):  # of the patterns
        found.sort(key=joints.index)
    return tuple(dict.fromkeys(found))


def _read_limits(clip: Mapping[str, tuple[float, float]], moved: Sequence[str]) -> Array | None:
    limits = np.full((2, len(moved)), [[-np.inf], [np.inf]])
    for pattern, pair in clip.items():
        limits[:, [_fits(pattern, joint) for joint in moved]] = np.transpose([pair])
    return limits if clip else None


def _read_motors(config: Config, key: str, joints: Sequence[str]) -> Array:
    """Read a figure of the groups of actuators; each joint is in one."""
    place, found = ("scene", "robot", "actuators"), np.full(len(joints), np.nan)
    for group in config.get(Table, *place):
        patterns = config.get(Texts, *place, group, "joint_names_expr")
        own = [i for i, joint in enumerate(joints) if any(_fits(p, joint) for p in patterns)]
        value = config.get(Numbers, *place, group, key)
        found[own] = _match(value, [joints[i] for i in own], missing=np.nan)
    if np.isnan(found).any():
        lacking = ", ".join(np.array(joints)[np.isnan(found)])
        raise ForeignPolicyError(f"{config.name(*place, '*', key)} is missing for {lacking}")
    return found


def _match(value: dict[str, float] | float, joints: Sequence[str], *, missing: float) -> Array:
    """Return one number for all joints, or numbers by patterns of their names."""
    found = np.full(len(joints), missing)
    for pattern, number in value.items() if isinstance(value, dict) else [(".*", value)]:
        found[[_fits(pattern, joint) for joint in joints]] = number
    return found


def _fits(pattern: str, joint: str) -> bool:
    """Match a name, unless that could take without end, as by `(j+)+x`.

    Each choice at most doubles the ways to match, and each repeat has a way for each length, if
    it is of no group. In verbose patterns, blanks or a comment may precede it.
    """
    repeats, choices = len(re.findall("[*+?{]", pattern[:200])), pattern[:200].count("|")
    ways = 2**choices * (len(joint) + 1) ** repeats
    if len(pattern) > 200 or re.search(r"\)[*+{\s#]", pattern) or ways > MOST_WAYS:
        raise ForeignPolicyError(
            f"pattern '{pattern:.40}' could take too long to match '{joint:.40}', expected no "
            "repeated groups, and fewer of * + ? and |, such as .*_(hip|knee)_.*"
        )
    try:
        return re.fullmatch(pattern, joint) is not None
    except (re.error, OverflowError, ValueError) as error:
        raise ForeignPolicyError(f"pattern '{pattern}' is malformed: {error}") from None


def _read_terms(config: Config, joints: int, actions: int) -> tuple[ForeignTerm, ...]:
    groups = config.get(Table, "observations")
    place = ("observations", next((name for name in GROUPS if name in groups), GROUPS[0]))
    terms = {
        label: term for label, term in config.get(Table, *place).items() if isinstance(term, dict)
    }
    names = [_last_word(config.get(Text, *place, label, "func")) for label in terms]
    check_terms(names)
    history = config.get(Table, *place).get("history_length")
    for label in terms:
        asset = (*place, label, "params", "asset_cfg", "joint_names")
        if (joint_names := config.get(Any, *asset, default=".*")) not in ([".*"], ".*"):
            raise ForeignPolicyError(
                f"{config.name(*place, label, 'params')} has joint_names {joint_names!r:.40}, "
                "expected all joints"
            )
    return tuple(
        make_term(
            name,
            find_size(name, joints, actions) or 3,
            scale=term.get("scale"),
            clip=term.get("clip"),
            history=history or term.get("history_length") or 0,
            is_offset=name != "joint_pos",
            label=label,
        )
        for name, (label, term) in zip(names, terms.items(), strict=True)
    )


def _last_word(function: Any) -> str:
    """Return the name of a function or class from `module:name`."""
    return re.split(r"[:.]", str(function))[-1]
