"""Descriptions in the metadata of ONNX files: those of mjlab and of microduck."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from humanoid_getup.policy.foreign.description import (
    MOST_HISTORY,
    ForeignNetwork,
    ForeignPolicy,
    ForeignPolicyError,
    ForeignTerm,
    check_terms,
    find_size,
    make_term,
    spread,
)
from robots.quaternion import Array
from robots.storage.validation import Names, read_table, within

MICRODUCK_KEY = "microduck"
MJLAB_KEYS = ("joint_names", "observation_names", "action_scale", "default_joint_pos")
ASSUMED_RATE = 50.0  # Hz; mjlab's tasks step at 50 Hz, which its metadata does not state
NO_GAIN = 1.0  # N·m/rad that mjlab writes where the model does not have the gain (its issue 347)


def read_mjlab(network: ForeignNetwork, gain: float | None) -> ForeignPolicy:
    """Read the description that mjlab writes, lists as texts with commas.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    data = network.metadata
    joints, names = _split(data["joint_names"]), _split(data["observation_names"])
    n, k = len(joints), network.action
    check_terms(names)
    if k != n:
        raise ForeignPolicyError(
            f"it has {k} actions for {n} joint_names: which ones they move is not in its metadata"
        )
    default, damping = _numbers(data, "default_joint_pos", n), None
    if "joint_damping" in data:
        damping = np.abs(_numbers(data, "joint_damping", n))
    return ForeignPolicy(
        format="mjlab",
        joints=joints,
        moved=joints,
        default_pos=default,
        scale=_numbers(data, "action_scale", k),
        offset=default,
        position_gain=None if gain else _read_gain(data, n),
        damping=damping,
        rate=ASSUMED_RATE,
        observation=_read_terms(data, names, n, network),
        sources={
            "joints": "ONNX metadata joint_names",
            "default_pos": "ONNX metadata default_joint_pos",
            "action": "ONNX metadata action_scale; mode assumed",
            "position_gain": _find_source(data, "joint_stiffness"),
            "damping": _find_source(data, "joint_damping"),
            "rate": "assumed",
            "observation": "ONNX metadata observation_names",
        },
    )


@dataclass(frozen=True, kw_only=True)
class Microduck:
    """What microduck writes under one key, as JSON."""

    joint_names: Names
    default_joint_pos: Annotated[Any, Meta(description="numbers")]
    action_scale: Annotated[Any, Meta(description="numbers")]
    control_hz: Annotated[float, within(0.1, 10_000.0, "Hz")]
    observation: Annotated[Any, Meta(description="[[name, width], ...]")]
    kp_fw: Annotated[float, within(0.0, 1e5)] | None = None
    """A register value of the servos."""


def read_microduck(network: ForeignNetwork) -> ForeignPolicy:
    """Read the description that microduck writes.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    record = _read_json(network.metadata[MICRODUCK_KEY])
    joints, layout = record.joint_names, _read_layout(record.observation)
    check_terms([name for name, _ in layout])
    default = spread(record.default_joint_pos, len(joints), "default_joint_pos")
    return ForeignPolicy(
        format="microduck",
        joints=joints,
        moved=joints,
        default_pos=default,
        scale=spread(record.action_scale, network.action, "action_scale"),
        offset=default,
        p_gain=record.kp_fw,
        rate=record.control_hz,
        observation=tuple(make_term(name, size) for name, size in layout),
        sources={
            "joints": "ONNX metadata microduck.joint_names",
            "default_pos": "ONNX metadata microduck.default_joint_pos",
            "action": "ONNX metadata microduck.action_scale",
            "position_gain": "assumed" if record.kp_fw is None else "ONNX metadata microduck.kp_fw",
            "damping": "assumed",
            "rate": "ONNX metadata microduck.control_hz",
            "observation": "ONNX metadata microduck.observation",
        },
    )


def _read_terms(
    data: dict[str, str], names: tuple[str, ...], n: int, network: ForeignNetwork
) -> tuple[ForeignTerm, ...]:
    """Read the terms; their sizes are not stated, and that of one command is what is left."""
    count, key = len(names), "observation_terms_history_length"
    scales = _read_a_term(data, "observation_terms_scale", count)
    clips = _read_a_term(data, "observation_terms_clip", count)
    steps = [0.0 if step is None else step for step in _read_a_term(data, key, count)]
    if not all(isinstance(step, float) and 0 <= step <= MOST_HISTORY for step in steps):
        raise ForeignPolicyError(f"{key} is {data[key]!r:.40}, expected 0 to {MOST_HISTORY} steps")
    histories = [max(1, int(step)) for step in steps]
    sizes = [find_size(name, n, network.action) for name in names]
    unknown = [i for i, size in enumerate(sizes) if size is None]
    if len(unknown) > 1:
        listed = ", ".join(names[i] for i in unknown)
        raise ForeignPolicyError(f"the sizes of observations {listed} are not in its metadata")
    left = network.observation - sum(
        (size or 0) * history for size, history in zip(sizes, histories, strict=True)
    )
    rows = zip(names, sizes, scales, clips, histories, strict=True)
    return tuple(
        make_term(name, size or max(left // history, 1), scale=scale, clip=clip, history=history)
        for name, size, scale, clip, history in rows
    )


def _read_gain(data: dict[str, str], n: int) -> Array | None:
    if "joint_stiffness" not in data:
        return None
    gain = _numbers(data, "joint_stiffness", n)
    if np.all(gain == NO_GAIN):
        raise ForeignPolicyError(
            "joint_stiffness is 1 N·m/rad for every joint, which mjlab writes for actuators "
            "whose gain it does not know: expected the gain of the training with --gain"
        )
    return gain


def _find_source(data: dict[str, str], key: str) -> str:
    return f"ONNX metadata {key}" if key in data else "assumed"


def _split(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _numbers(data: dict[str, str], key: str, size: int) -> Array:
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
        raise ForeignPolicyError(f"{key} is {data[key]!r:.60}, expected numbers") from None


def _read_a_term(data: dict[str, str], key: str, count: int) -> list[Any]:
    """Read a value for each term; ``None`` for all if none is stated."""
    values = _read_values(data, key) if key in data else [None] * count
    if len(values) != count:
        raise ForeignPolicyError(f"its metadata has {len(values)} values for {count} observations")
    return values


def _read_json(text: str) -> Microduck:
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ForeignPolicyError(f"its metadata 'microduck' is not JSON: {error}") from None
    if not isinstance(record, dict):
        raise ForeignPolicyError("its metadata 'microduck' is not a JSON object")
    problems: list[str] = []
    found = read_table(Microduck, record, "microduck.", problems)
    if problems:
        raise ForeignPolicyError("; ".join(problems))
    return found


def _read_layout(rows: Any) -> list[tuple[str, int]]:
    try:
        layout = [(str(name), int(size)) for name, size in rows]
    except (TypeError, ValueError, OverflowError):
        layout = []
    if not layout or not all(0 < size <= 10_000 for _, size in layout):
        raise ForeignPolicyError(
            "microduck.observation is malformed, expected [[name, width], ...]"
        )
    return layout
