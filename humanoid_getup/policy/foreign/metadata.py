"""Descriptions in the metadata of ONNX files: those of mjlab and of microduck."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from humanoid_getup.policy.action import ActionMode
from humanoid_getup.policy.foreign.config_file import ConfigTable
from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    ForeignTerm,
    Given,
    NetworkShape,
    spread,
)
from humanoid_getup.policy.foreign.terms import MOST_HISTORY, check_terms, find_size, make_term

MICRODUCK_KEY = "microduck"
MJLAB_KEYS = ("joint_names", "observation_names", "action_scale", "default_joint_pos")
ASSUMED_RATE = 50.0  # Hz; mjlab's tasks step at 50 Hz, which its metadata does not state
NO_GAIN = 1.0  # N·m/rad that mjlab writes where the model does not have the gain (its issue 347)


def read_mjlab(shape: NetworkShape, given: Given) -> ForeignPolicy:
    """Read the description that mjlab writes, lists as texts with commas.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    data = shape.metadata
    if missing := [key for key in MJLAB_KEYS if key not in data]:
        raise ForeignPolicyError(f"its metadata lacks {', '.join(missing)}, which mjlab writes")
    joints, names = _split(data["joint_names"]), _split(data["observation_names"])
    n, k = len(joints), shape.action
    check_terms(names)
    if k != n:
        raise ForeignPolicyError(
            f"it has {k} actions for {n} joint_names: which ones they move is not in its metadata"
        )
    sources = {name: f"ONNX metadata {name}" for name in data}
    default = spread(_numbers(data, "default_joint_pos"), n, "default_joint_pos")
    gain = None if given.gain is not None else _read_gain(data, n)
    return ForeignPolicy(
        format=ForeignFormat.MJLAB,
        joints=joints,
        moved=joints,
        default_pos=default,
        mode=ActionMode.ABSOLUTE,
        scale=spread(_numbers(data, "action_scale"), k, "action_scale"),
        offset=default,
        position_gain=gain if given.gain is None else np.full(n, given.gain),
        damping=_read_damping(data, n),
        rate=given.rate or ASSUMED_RATE,
        observation=_read_terms(data, names, n, shape),
        sources={
            "joints": sources["joint_names"],
            "default_pos": sources["default_joint_pos"],
            "action": f"{sources['action_scale']}; mode assumed",
            "position_gain": _say(given.gain, sources.get("joint_stiffness"), "--gain"),
            "damping": sources.get("joint_damping", "assumed"),
            "rate": _say(given.rate, None, "--rate"),
            "observation": sources["observation_names"],
        },
    )


def read_microduck(shape: NetworkShape, given: Given) -> ForeignPolicy:
    """Read the description that microduck writes under one key, as JSON.

    Its gain is a register value of the servos.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    record = _read_json(shape.metadata[MICRODUCK_KEY])
    wanted = ("joint_names", "default_joint_pos", "action_scale", "control_hz", "observation")
    if missing := [key for key in wanted if key not in record]:
        raise ForeignPolicyError(f"its metadata 'microduck' lacks {', '.join(missing)}")
    joints = ConfigTable(record, "microduck").texts("joint_names")
    n, k = len(joints), shape.action
    layout = _read_layout(record["observation"])
    check_terms([name for name, _ in layout])
    default = spread(record["default_joint_pos"], n, "default_joint_pos")
    rate = given.rate or float(spread(record["control_hz"], 1, "control_hz")[0])
    source = {key: f"ONNX metadata microduck.{key}" for key in record}
    return ForeignPolicy(
        format=ForeignFormat.MICRODUCK,
        joints=joints,
        moved=joints,
        default_pos=default,
        mode=ActionMode.ABSOLUTE,
        scale=spread(record["action_scale"], k, "action_scale"),
        offset=default,
        position_gain=None if given.gain is None else np.full(n, given.gain),
        p_gain=_read_register(record) if given.gain is None else None,
        damping=None,
        rate=rate,
        observation=tuple(make_term(name, size) for name, size in layout),
        sources={
            "joints": source["joint_names"],
            "default_pos": source["default_joint_pos"],
            "action": source["action_scale"],
            "position_gain": _say(given.gain, source.get("kp_fw"), "--gain"),
            "damping": "assumed",
            "rate": _say(given.rate, source["control_hz"], "--rate"),
            "observation": source["observation"],
        },
    )


def _read_register(record: dict[str, Any]) -> float | None:
    if "kp_fw" not in record:
        return None
    return float(spread(record["kp_fw"], 1, "kp_fw")[0])


def _read_terms(
    data: dict[str, str], names: tuple[str, ...], n: int, shape: NetworkShape
) -> tuple[ForeignTerm, ...]:
    """Read the terms; their sizes are not stated, and that of one command is what is left."""
    count = len(names)
    scales = _nested(data.get("observation_terms_scale"), count, 1.0)
    clips = _nested(data.get("observation_terms_clip"), count, None)
    histories = _read_histories(data.get("observation_terms_history_length"), count)
    sizes = [find_size(name, n, shape.action) for name in names]
    open_ = [i for i, size in enumerate(sizes) if size is None]
    if len(open_) > 1:
        listed = ", ".join(names[i] for i in open_)
        raise ForeignPolicyError(f"the sizes of observations {listed} are not in its metadata")
    if open_:
        known = sum((size or 0) * h for size, h in zip(sizes, histories, strict=True))
        sizes[open_[0]] = max((shape.observation - known) // histories[open_[0]], 1)
    rows = zip(names, sizes, scales, clips, histories, strict=True)
    return tuple(
        make_term(name, size or 1, scale=scale, clip=clip, history=history)
        for name, size, scale, clip, history in rows
    )


def _read_histories(text: str | None, count: int) -> list[int]:
    """Read numbers of steps; 0 is the present alone."""
    steps = _nested(text, count, 1.0)
    if not all(isinstance(each, float) and 0 <= each <= MOST_HISTORY for each in steps):
        raise ForeignPolicyError(
            f"observation_terms_history_length is {text!r:.40}, expected 0 to {MOST_HISTORY} steps"
        )
    return [max(1, int(each)) for each in steps]


def _read_gain(data: dict[str, str], n: int) -> np.ndarray | None:
    if "joint_stiffness" not in data:
        return None
    gain = spread(_numbers(data, "joint_stiffness"), n, "joint_stiffness")
    if np.all(gain == NO_GAIN):
        raise ForeignPolicyError(
            "joint_stiffness is 1 N·m/rad for every joint, which mjlab writes for actuators "
            "whose gain it does not know: expected the gain of the training with --gain"
        )
    return gain


def _read_damping(data: dict[str, str], n: int) -> np.ndarray | None:
    if "joint_damping" not in data:
        return None
    return np.abs(spread(_numbers(data, "joint_damping"), n, "joint_damping"))


def _say(given: float | None, source: str | None, option: str) -> str:
    return option if given is not None else source or "assumed"


def _split(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _numbers(data: dict[str, str], key: str) -> list[float]:
    try:
        return [float(part) for part in _split(data[key].strip("[]"))]
    except ValueError:
        raise ForeignPolicyError(f"{key} is {data[key]!r:.60}, expected numbers") from None


def _nested(text: str | None, count: int, default: Any) -> list[Any]:
    """Read a value for each term: numbers, words and lists of numbers, with commas."""
    if text is None:
        return [default] * count
    parts = re.findall(r"\[[^\[\]]*\]|[^,\[\]]+", text)
    values = [_read_value(part.strip()) for part in parts if part.strip()]
    if len(values) != count:
        raise ForeignPolicyError(f"its metadata has {len(values)} values for {count} observations")
    return values


def _read_value(part: str) -> Any:
    try:
        if part.startswith("["):
            return [float(number) for number in _split(part.strip("[]"))]
        return float(part)
    except ValueError:
        raise ForeignPolicyError(f"its metadata has {part!r:.40}, expected a number") from None


def _read_json(text: str) -> dict[str, Any]:
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ForeignPolicyError(f"its metadata 'microduck' is not JSON: {error}") from None
    if not isinstance(record, dict):
        raise ForeignPolicyError("its metadata 'microduck' is not a JSON object")
    return record


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
