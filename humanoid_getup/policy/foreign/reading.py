"""Reads networks that were trained elsewhere, with what describes them.

That is Isaac Lab's env.yaml, or the metadata of ONNX files: those of mjlab and of microduck.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import onnx
from msgspec import Meta
from onnx import ModelProto, TensorProto, external_data_helper

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
from humanoid_getup.policy.foreign.isaac_env import read_isaac_env
from humanoid_getup.policy.foreign.wrapping import find_inputs
from humanoid_getup.policy.onnx_file import (
    CONTRACT_KEY,
    EXTERNAL_WEIGHTS,
    MAX_BYTES,
    describe_refusal,
    find_content_problems,
    read_metadata,
)
from robots.quaternion import Array
from robots.storage.files import check_file, describe, read_bounded
from robots.storage.validation import Names, between, read_table, whole

PICKLES = (b"PK\x03\x04", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")
"""First bytes of files that torch and pickle write."""
PICKLE_SUFFIXES = (".pt", ".pth", ".pkl", ".pickle", ".jit")


def read_network(file: Path) -> ForeignNetwork:
    """Read an ONNX file that maps one vector to one."""
    content = read_bounded(file, MAX_BYTES)
    if content.startswith(PICKLES) or file.suffix in PICKLE_SUFFIXES:
        raise ValueError(
            "it is a pickle of torch, which is never opened, since that runs code in it: export "
            "it to ONNX where it was trained"
        )
    try:
        problems, metadata = find_content_problems(content), read_metadata(content)
    except ValueError as error:
        raise ValueError(f"it is not an ONNX file: {error}") from error
    if CONTRACT_KEY in metadata:
        raise ValueError("it has a policy contract of ours: `getup run` plays it as it is")
    if problems := [problem for problem in problems if problem != EXTERNAL_WEIGHTS]:
        raise ValueError("; ".join(problems))
    try:
        model = onnx.load_from_string(content)
        _load_weights(model, file.parent)
        onnx.checker.check_model(model)
    except ValueError:
        raise
    except Exception as error:  # protobuf's and onnx's errors have no base of their own
        raise ValueError(describe_refusal(onnx, error)) from error
    return ForeignNetwork(
        model=model,
        metadata=metadata,
        observation=_measure("input", find_inputs(model)),
        action=_measure("output", list(model.graph.output)),
    )


def describe_policy(
    network: ForeignNetwork,
    config: Path | None = None,
    *,
    joints: tuple[str, ...] = (),
    rate: float | None = None,
    gain: float | None = None,
) -> ForeignPolicy:
    """Read the description of a policy from Isaac Lab's env.yaml, or else from its metadata.

    Names of joints are those that files only number. A rate [Hz] and a position gain [N·m/rad]
    count more than what is described.
    """
    if config is not None:
        policy = read_isaac_env(config, network, joints, gain)
    elif MICRODUCK_KEY in network.metadata:
        policy = read_microduck(network)
    elif all(key in network.metadata for key in MJLAB_KEYS):
        policy = read_mjlab(network, gain)
    else:
        raise ValueError(
            "nothing describes it, expected an ONNX file with the metadata of mjlab or microduck, "
            "or Isaac Lab's env.yaml with --config"
        )
    sources = dict(policy.sources)
    if gain:
        kp, sources["position_gain"] = np.full(len(policy.joints), gain), "--gain"
        policy = replace(policy, position_gain=kp, p_gain=None, sources=sources)
    if rate:
        sources["rate"] = "--rate"
        policy = replace(policy, rate=rate, sources=sources)
    _check_sizes(policy, network)
    return policy


def _check_sizes(policy: ForeignPolicy, network: ForeignNetwork) -> None:
    n, k = len(policy.joints), network.action
    problems = [
        f"observation '{term.name}' has {term.size} numbers, expected {size}"
        for term in policy.observation
        if term.size != (size := find_size(term.quantity, n, k) or term.size)
    ]
    if policy.observation_size != network.observation:
        problems.append(
            f"its network takes {network.observation} numbers, its terms are "
            f"{policy.observation_size} ({policy.sources['observation']}): "
            + " ".join(f"{t.name}[{t.size * t.history}]" for t in policy.observation)
        )
    if len(policy.moved) != network.action:
        problems.append(
            f"its network returns {network.action} numbers, its actions are {len(policy.moved)}"
        )
    if not 0.1 <= policy.rate <= 10_000.0:
        problems.append(f"its rate is {policy.rate:g} Hz, expected 0.1 to 10000 Hz")
    if problems:
        raise ValueError("; ".join(problems))


def _load_weights(model: ModelProto, folder: Path) -> None:
    """Read weights that lie in other files of the same folder."""
    size = 0
    for tensor in model.graph.initializer:
        if not external_data_helper.uses_external_data(tensor):
            continue
        name = {entry.key: entry.value for entry in tensor.external_data}.get("location", "")
        if not name or Path(name).name != name:
            raise ValueError(f"its weights are in '{name:.60}', expected a file beside it")
        try:
            check_file(folder / name, MAX_BYTES)
        except (OSError, ValueError) as error:
            raise ValueError(f"its weights in {name}: {describe(error)}") from error
        external_data_helper.load_external_data_for_tensor(tensor, str(folder))
        size += len(tensor.raw_data)
        if size > MAX_BYTES:  # many tensors may name the same bytes of a file
            raise ValueError(f"its weights have more than {MAX_BYTES} bytes")
        tensor.data_location = TensorProto.DEFAULT
        del tensor.external_data[:]


def _measure(what: str, values: list[Any]) -> int:
    """Return the size of the one input or output of a network, of shape (N, size)."""
    if len(values) != 1:
        named = ", ".join(value.name for value in values) or "none"
        raise ValueError(
            f"its network has {len(values)} {what}s ({named}), expected one: export it without "
            "memory, values or a motion of its own"
        )
    (value,) = values
    tensor = value.type.tensor_type
    kinds = {number: name.lower() for name, number in TensorProto.DataType.items()}
    if (kind := kinds.get(tensor.elem_type, "of no type")) != "float":
        raise ValueError(
            f"'{value.name}' of its network is {kind}, expected 32-bit float: export it so"
        )
    sizes = [dim.dim_value for dim in tensor.shape.dim]
    if len(sizes) != 2 or sizes[0] not in (0, 1) or sizes[1] < 1:
        raise ValueError(f"'{value.name}' of its network has shape {sizes}, expected (N, size)")
    return sizes[1]


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
    control_hz: Annotated[float, between(0.1, 10_000.0, "Hz")]
    observation: Annotated[
        tuple[tuple[str, Annotated[int, whole(1, 10_000)]], ...],
        Meta(min_length=1, description="[[name, width], ...]"),
    ]
    kp_fw: Annotated[float, between(0.0, 1e5)] | None = None
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
