"""Descriptions in the env.yaml that Isaac Lab writes beside a training; no code in it is run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from humanoid_getup.policy.action import ActionMode
from humanoid_getup.policy.foreign.description import (
    ForeignNetwork,
    ForeignPolicy,
    ForeignTerm,
    check_terms,
    find_size,
    make_term,
)
from robots.quaternion import Array
from robots.storage.validation import parse_file, reading
from robots.storage.yaml_text import parse_yaml

MODES = {
    "JointPositionAction": ActionMode.ABSOLUTE,
    "RelativeJointPositionAction": ActionMode.OFFSET,
}
GROUPS = ("policy", "actor")  # names of the observation group that the network sees
MOST_WAYS = 1_000_000  # in which a pattern may match a name; all are tried within about 10 ms

Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
Positive = Annotated[float, Meta(gt=1e-9, lt=1e6, description="a number above 0")]
Figures = dict[str, float] | float
Numbers = Annotated[dict[str, Number] | Number, Meta(description="numbers")]
Limits = Annotated[dict[str, tuple[Number, Number]], Meta(description="two numbers a joint")]
Texts = Annotated[tuple[str, ...], Meta(description="texts")]
Text = Annotated[str, Meta(description="a text")]
Choice = Annotated[bool, Meta(description="true or false")]
Table = Annotated[dict[str, Any], Meta(description="a table")]


@dataclass(frozen=True)
class Config:
    """Values of a YAML file by the paths of their keys, which messages and sources name."""

    file: str
    values: Any

    def get(self, path: str, kind: Any, default: Any = None) -> Any:
        """Return a value of an annotated type; the default if it is missing or null."""
        value, place = self.values, self.file
        for key in path.split("."):
            if not isinstance(value, dict):
                raise ValueError(f"{place} is {value!r:.40}, expected a table")
            place += f".{key}" if place != self.file else f" {key}"
            if (value := value.get(key)) is None:
                if default is None:
                    raise ValueError(f"{place} is missing")
                return default
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError:
            expected = kind.__metadata__[0].description
            raise ValueError(f"{place} is {value!r:.40}, expected {expected}") from None


def read_isaac_env(
    file: Path, network: ForeignNetwork, joints: tuple[str, ...], gain: float | None
) -> ForeignPolicy:
    """Read an env.yaml; the order of the joints is given, as it has none."""
    with reading(str(file)):  # tagged Python objects are the lists or tables that they tag
        values = parse_file(file, "YAML", parse_yaml)
    if not isinstance(values, dict):
        raise ValueError(f"{file} holds no table, expected Isaac Lab's env.yaml")
    config, name = Config(file.name, values), file.name
    if not joints:
        raise ValueError(
            f"{name} does not state the order of the joints: expected their names in the "
            "simulator's order with --joints NAME,..."
        )
    default = _match(config.get("scene.robot.init_state.joint_pos", Numbers), joints)
    action, mode = _find_action(config)
    patterns = config.get(f"{action}.joint_names", Texts, (".*",))
    found = [joint for pattern in patterns for joint in joints if _fits(pattern, joint)]
    if not found:
        raise ValueError(f"{name} {action}.joint_names fits none of --joints")
    if not config.get(f"{action}.preserve_order", Choice, False):  # of the patterns
        found.sort(key=joints.index)
    moved = tuple(dict.fromkeys(found))
    offset = default[[joints.index(joint) for joint in moved]]
    if not config.get(f"{action}.use_default_offset", Choice, True):
        offset = _match(config.get(f"{action}.offset", Numbers, 0.0), moved)
    limits = np.full((2, len(moved)), [[-np.inf], [np.inf]])
    clip = config.get(f"{action}.clip", Limits, {})
    for pattern, pair in clip.items():
        limits[:, [_fits(pattern, joint) for joint in moved]] = np.transpose([pair])
    motors = "scene.robot.actuators"
    return ForeignPolicy(
        format="isaac",
        joints=joints,
        moved=moved,
        default_pos=default,
        mode=mode,
        scale=_match(config.get(f"{action}.scale", Numbers, 1.0), moved, missing=1.0),
        offset=offset,
        limits=limits if clip else None,
        position_gain=None if gain else _read_motors(config, motors, "stiffness", joints),
        damping=_read_motors(config, motors, "damping", joints),
        rate=1.0 / (config.get("sim.dt", Positive) * config.get("decimation", Positive)),
        observation=_read_terms(config, len(joints), network.action),
        sources={
            "joints": "--joints",
            "default_pos": f"{name} scene.robot.init_state.joint_pos",
            "action": f"{name} {action}.class_type, scale, offset",
            "position_gain": f"{name} {motors}.*.stiffness",
            "damping": f"{name} {motors}.*.damping",
            "rate": f"{name} sim.dt and decimation",
            "observation": f"{name} observations",
        },
    )


def _find_action(config: Config) -> tuple[str, ActionMode]:
    """Find the place of the one action that moves joints to positions, and its mode."""
    kinds = {
        name: _last_word(action.get("class_type", ""))
        for name, action in config.get("actions", Table).items()
        if isinstance(action, dict)
    }
    if len(kinds) != 1 or not MODES.keys() & kinds.values():
        found = ", ".join(f"{name} ({kind})" for name, kind in kinds.items()) or "none"
        raise ValueError(
            f"{config.file} actions.*: {found}, expected one action, {' or '.join(MODES)}"
        )
    ((name, kind),) = kinds.items()
    return f"actions.{name}", MODES[kind]


def _read_motors(config: Config, place: str, key: str, joints: Sequence[str]) -> Array:
    """Read a figure of the groups of actuators; each joint is in one."""
    found = np.full(len(joints), np.nan)
    for group in config.get(place, Table):
        patterns = config.get(f"{place}.{group}.joint_names_expr", Texts)
        own = [i for i, joint in enumerate(joints) if any(_fits(p, joint) for p in patterns)]
        value = config.get(f"{place}.{group}.{key}", Numbers)
        found[own] = _match(value, [joints[i] for i in own], missing=np.nan)
    if np.isnan(found).any():
        lacking = ", ".join(np.array(joints)[np.isnan(found)])
        raise ValueError(f"{config.file} {place}.*.{key} is missing for {lacking}")
    return found


def _match(value: Figures, joints: Sequence[str], missing: float = 0.0) -> Array:
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
        raise ValueError(
            f"pattern '{pattern:.40}' could take too long to match '{joint:.40}', expected no "
            "repeated groups, and fewer of * + ? and |, such as .*_(hip|knee)_.*"
        )
    try:
        return re.fullmatch(pattern, joint) is not None
    except (re.error, OverflowError, ValueError) as error:
        raise ValueError(f"pattern '{pattern}' is malformed: {error}") from None


def _read_terms(config: Config, joints: int, actions: int) -> tuple[ForeignTerm, ...]:
    groups = config.get("observations", Table)
    place = f"observations.{next((name for name in GROUPS if name in groups), GROUPS[0])}"
    table = config.get(place, Table)
    terms = {label: term for label, term in table.items() if isinstance(term, dict)}
    names = [_last_word(config.get(f"{place}.{label}.func", Text)) for label in terms]
    check_terms(names)
    for label in terms:
        chosen = config.get(f"{place}.{label}.params.asset_cfg.joint_names", Any, ".*")
        if chosen not in ([".*"], ".*"):
            raise ValueError(
                f"{config.file} {place}.{label}.params has joint_names {chosen!r:.40}, "
                "expected all joints"
            )
    return tuple(
        make_term(
            name,
            find_size(name, joints, actions) or 3,
            scale=term.get("scale"),
            clip=term.get("clip"),
            history=table.get("history_length") or term.get("history_length"),
            is_offset=name != "joint_pos",
            label=label,
        )
        for name, (label, term) in zip(names, terms.items(), strict=True)
    )


def _last_word(function: object) -> str:
    """Return the name of a function or class from `module:name`."""
    return re.split(r"[:.]", str(function))[-1]
