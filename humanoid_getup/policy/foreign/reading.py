"""Reads networks that were trained elsewhere, with whatever describes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import ModelProto, TensorProto, external_data_helper

from humanoid_getup.policy.foreign.description import (
    ForeignNetwork,
    ForeignPolicy,
    find_size,
)
from humanoid_getup.policy.foreign.isaac_env import read_isaac_env
from humanoid_getup.policy.foreign.metadata import (
    MICRODUCK_KEY,
    MJLAB_KEYS,
    read_microduck,
    read_mjlab,
)
from humanoid_getup.policy.foreign.wrapping import find_inputs
from humanoid_getup.policy.onnx_content import (
    EXTERNAL_WEIGHTS,
    find_content_problems,
    read_metadata,
)
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, MAX_BYTES, describe_refusal
from robots.storage.files import check_file, describe, read_bounded

PICKLES = (b"PK\x03\x04", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")
"""First bytes of files that torch and pickle write."""
PICKLE_SUFFIXES = (".pt", ".pth", ".pkl", ".pickle", ".jit")


def read_network(file: Path) -> ForeignNetwork:
    """Read an ONNX file that maps one vector to one.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is a pickle, or another thing than such a network.
    """
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

    Raises:
        ValueError: naming what is missing or wrong.
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
