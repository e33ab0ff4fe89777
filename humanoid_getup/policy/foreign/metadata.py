"""Descriptions in the metadata of ONNX files: those of mjlab and of microduck."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from humanoid_getup.policy.foreign.description import (
    ForeignNetwork,
    ForeignPolicy,
    ForeignTerm,
    check_terms,
    find_size,
    make_term,
    read_history,
    spread,
)
from robots.quaternion import Array
from robots.storage.validation import Names, read_table, whole, within

MICRODUCK_KEY = "microduck"
MJLAB_KEYS = ("joint_names", "observation_names", "action_scale", "default_joint_pos")
ASSUMED_RATE = 50.0  # Hz; mjlab's tasks step at 50 Hz, which its metadata does not state
NO_GAIN = 1.0  # N·m/rad that mjlab writes where the model does not have the gain (its issue 347)


def read_mjlab(network: ForeignNetwork, gain: float | None) -> ForeignPolicy:
    """Read the description that mjlab writes, lists as texts with commas."""
    data = network.metadata
    joints, names = _split(data["joint_names"]), _split(data["observation_names"])
    check_terms(names)
    if network.action != len(joints):
        raise ValueError(
            f"it has {network.action} actions for {len(joints)} joint_names: which ones they move "
            "is not in its metadata"
        )
    figures = {
        key: _read_numbers(data, key, len(joints))
        for key in ("default_joint_pos", "action_scale", "joint_stiffness", "joint_damping")
        if key in data and not (gain and key == "joint_stiffness")
    }
    stiffness, damping = figures.get("joint_stiffness"), figures.get("joint_damping")
    if stiffness is not None and np.all(stiffness == NO_GAIN):
        raise ValueError(
            "joint_stiffness is 1 N·m/rad for every joint, which mjlab writes for actuators "
            "whose gain it does not know: expected the gain of the training with --gain"
        )
    sources = {
        "joints": "joint_names",
        "default_pos": "default_joint_pos",
        "action": "action_scale; mode assumed",
        "position_gain": "joint_stiffness" * ("joint_stiffness" in data),
        "damping": "joint_damping" * (damping is not None),
        "rate": "",
        "observation": "observation_names",
    }
    return ForeignPolicy(
        format="mjlab",
        joints=joints,
        moved=joints,
        default_pos=figures["default_joint_pos"],
        scale=figures["action_scale"],
        offset=figures["default_joint_pos"],
        position_gain=stiffness,
        damping=None if damping is None else np.abs(damping),
        rate=ASSUMED_RATE,
        observation=_read_terms(data, names, len(joints), network),
        sources=_name_sources(sources),
    )


@dataclass(frozen=True, kw_only=True)
class Microduck:
    """What microduck writes under one key, as JSON."""

    joint_names: Names
    default_joint_pos: Annotated[Any, Meta(description="numbers")]
    action_scale: Annotated[Any, Meta(description="numbers")]
    control_hz: Annotated[float, within(0.1, 10_000.0, "Hz")]
    observation: Annotated[
        tuple[tuple[str, Annotated[int, whole(1, 10_000)]], ...],
        Meta(min_length=1, description="[[name, width], ...]"),
    ]
    kp_fw: Annotated[float, within(0.0, 1e5)] | None = None
    """A register value of the servos."""


def read_microduck(network: ForeignNetwork) -> ForeignPolicy:
    """Read the description that microduck writes."""
    try:
        table = json.loads(network.metadata[MICRODUCK_KEY])
    except (ValueError, RecursionError) as error:
        raise ValueError(f"its metadata 'microduck' is not JSON: {error}") from None
    if not isinstance(table, dict):
        raise ValueError("its metadata 'microduck' is not a JSON object")
    record = read_table(Microduck, table, "microduck.", problems := list[str]())
    if problems:
        raise ValueError("; ".join(problems))
    check_terms([name for name, _ in record.observation])
    default = spread(record.default_joint_pos, len(record.joint_names), "default_joint_pos")
    sources = {
        "joints": "microduck.joint_names",
        "default_pos": "microduck.default_joint_pos",
        "action": "microduck.action_scale",
        "position_gain": "microduck.kp_fw" * (record.kp_fw is not None),
        "damping": "",
        "rate": "microduck.control_hz",
        "observation": "microduck.observation",
    }
    return ForeignPolicy(
        format="microduck",
        joints=record.joint_names,
        moved=record.joint_names,
        default_pos=default,
        scale=spread(record.action_scale, network.action, "action_scale"),
        offset=default,
        p_gain=record.kp_fw,
        rate=record.control_hz,
        observation=tuple(make_term(name, size) for name, size in record.observation),
        sources=_name_sources(sources),
    )


def _name_sources(keys: dict[str, str]) -> dict[str, str]:
    return {field: f"ONNX metadata {key}" if key else "assumed" for field, key in keys.items()}


def _read_terms(
    data: dict[str, str], names: tuple[str, ...], n: int, network: ForeignNetwork
) -> tuple[ForeignTerm, ...]:
    """Read the terms; their sizes are not stated, and that of one command is what is left."""

    def read(key: str) -> list[Any]:
        values = _read_values(data, key) if key in data else [None] * len(names)
        if len(values) != len(names):
            raise ValueError(f"its metadata has {len(values)} values for {len(names)} observations")
        return values

    scales, clips = read("observation_terms_scale"), read("observation_terms_clip")
    key = "observation_terms_history_length"
    histories = [read_history(steps, key) for steps in read(key)]
    sizes = [find_size(name, n, network.action) for name in names]
    unknown = [name for name, size in zip(names, sizes, strict=True) if size is None]
    if len(unknown) > 1:
        raise ValueError(f"the sizes of observations {', '.join(unknown)} are not in its metadata")
    rows = [*zip(names, sizes, scales, clips, histories, strict=True)]
    left = network.observation - sum((size or 0) * history for _, size, _, _, history in rows)
    return tuple(
        make_term(name, size or max(left // history, 1), scale=scale, clip=clip, history=history)
        for name, size, scale, clip, history in rows
    )


def _split(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _read_numbers(data: dict[str, str], key: str, size: int) -> Array:
    values = _read_values(data, key)
    return spread(values[0] if len(values) == 1 else values, size, key)


def _read_values(data: dict[str, str], key: str) -> list[Any]:
    """Read numbers, and lists of them in brackets, with commas."""
    parts = [part.strip() for part in re.findall(r"\[[^\[\]]*\]|[^,\[\]]+", data[key])]
    try:
        return [
            [float(number) for number in _split(part[1:-1])] if part[0] == "[" else float(part)
            for part in filter(None, parts)
        ]
    except ValueError:
        raise ValueError(f"{key} is {data[key]!r:.60}, expected numbers") from None
