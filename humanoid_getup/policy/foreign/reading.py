"""Reads networks that were trained elsewhere, with whatever describes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanoid_getup.policy.foreign.config_file import load_yaml
from humanoid_getup.policy.foreign.deploy_yaml import read_deploy_yaml
from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    Given,
    NetworkShape,
)
from humanoid_getup.policy.foreign.isaac_env import read_isaac_env
from humanoid_getup.policy.foreign.legged_gym import read_legged_gym
from humanoid_getup.policy.foreign.metadata import (
    MICRODUCK_KEY,
    MJLAB_KEYS,
    read_microduck,
    read_mjlab,
)
from humanoid_getup.policy.onnx_content import (
    EXTERNAL_WEIGHTS,
    find_content_problems,
    read_metadata,
)
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, MAX_BYTES, describe_refusal
from robots.storage.files import check_file, describe, read_bounded

if TYPE_CHECKING:
    from onnx import ModelProto

PICKLES = (b"PK\x03\x04", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")
"""First bytes of files that torch and pickle write."""
PICKLE_SUFFIXES = (".pt", ".pth", ".pkl", ".pickle", ".jit")
EXPECTED = (
    "an ONNX file with the metadata of mjlab or microduck, or --config with Unitree's deploy.yaml, "
    "Isaac Lab's env.yaml or legged_gym's config.py"
)
IN_METADATA = (ForeignFormat.MJLAB, ForeignFormat.MICRODUCK)


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignNetwork:
    """A network in an ONNX file that was trained elsewhere."""

    model: ModelProto
    shape: NetworkShape


def read_network(file: Path) -> ForeignNetwork:
    """Read an ONNX file that maps one vector to one.

    Raises:
        OSError: if it cannot be read.
        ForeignPolicyError: if it is a pickle, or another thing than such a network.
        ModuleNotFoundError: if the package onnx is missing.
    """
    try:
        content = read_bounded(file, MAX_BYTES)
    except ValueError as error:
        raise ForeignPolicyError(str(error)) from error
    if content.startswith(PICKLES) or file.suffix in PICKLE_SUFFIXES:
        raise ForeignPolicyError(
            "it is a pickle of torch, which is never opened, since that runs code in it: export "
            "it to ONNX where it was trained"
        )
    try:
        problems, metadata = find_content_problems(content), read_metadata(content)
    except ValueError as error:
        raise ForeignPolicyError(f"it is not an ONNX file: {error}") from error
    if CONTRACT_KEY in metadata:
        raise ForeignPolicyError("it has a policy contract of ours: `getup run` plays it as it is")
    if problems := [problem for problem in problems if problem != EXTERNAL_WEIGHTS]:
        raise ForeignPolicyError(*problems)
    model = _parse(content, file.parent)
    return ForeignNetwork(model=model, shape=_measure(model, metadata))


def describe_policy(
    shape: NetworkShape, kind: ForeignFormat | None, config: Sequence[Path], given: Given
) -> ForeignPolicy:
    """Read the description of a policy from its metadata or its configuration files.

    The format is guessed if it is not given.

    Raises:
        ForeignPolicyError: naming what is missing or wrong.
    """
    kind = kind or _guess_format(shape, config)
    if kind in IN_METADATA and config:
        raise ForeignPolicyError(f"--config is given, but the format is {kind}: expected none")
    if kind not in IN_METADATA and not config:
        raise ForeignPolicyError(f"the format is {kind}, expected its file with --config")
    policy = _read(kind, shape, config, given)
    _check_sizes(policy, shape)
    return policy


def _read(
    kind: ForeignFormat, shape: NetworkShape, config: Sequence[Path], given: Given
) -> ForeignPolicy:
    if kind is ForeignFormat.MJLAB:
        return read_mjlab(shape, given)
    if kind is ForeignFormat.MICRODUCK:
        if MICRODUCK_KEY not in shape.metadata:
            raise ForeignPolicyError("its metadata lacks the key 'microduck'")
        return read_microduck(shape, given)
    if kind is ForeignFormat.LEGGED_GYM:
        return read_legged_gym(config, shape, given)
    if len(config) > 1:
        raise ForeignPolicyError(f"--config has {len(config)} files, expected one for {kind}")
    reader = read_deploy_yaml if kind is ForeignFormat.UNITREE else read_isaac_env
    return reader(config[0], shape, given)


def _guess_format(shape: NetworkShape, config: Sequence[Path]) -> ForeignFormat:
    if config:
        return _guess_config(config[0])
    if MICRODUCK_KEY in shape.metadata:
        return ForeignFormat.MICRODUCK
    if all(key in shape.metadata for key in MJLAB_KEYS):
        return ForeignFormat.MJLAB
    raise ForeignPolicyError(f"nothing describes it, expected {EXPECTED}")


def _guess_config(file: Path) -> ForeignFormat:
    if file.suffix == ".py":
        return ForeignFormat.LEGGED_GYM
    table = load_yaml(file)
    if "joint_ids_map" in table:
        return ForeignFormat.UNITREE
    if {"scene", "observations", "actions"} <= table.keys():
        return ForeignFormat.ISAAC
    raise ForeignPolicyError(f"--config is {file}, of no known format: expected {EXPECTED}")


def _check_sizes(policy: ForeignPolicy, shape: NetworkShape) -> None:
    problems = []
    if policy.observation_size != shape.observation:
        problems.append(
            f"its network takes {shape.observation} numbers, its terms are "
            f"{policy.observation_size} ({policy.sources['observation']}): "
            + " ".join(f"{t.name}[{t.size * t.history}]" for t in policy.observation)
        )
    if len(policy.moved) != shape.action:
        problems.append(
            f"its network returns {shape.action} numbers, its actions are {len(policy.moved)}"
        )
    if not 0.1 <= policy.rate <= 10_000.0:
        problems.append(f"its rate is {policy.rate:g} Hz, expected 0.1 to 10000 Hz")
    if problems:
        raise ForeignPolicyError(*problems)


def _parse(content: bytes, folder: Path) -> ModelProto:
    import onnx

    try:
        model = onnx.load_from_string(content)
        _load_weights(model, folder)
        onnx.checker.check_model(model)
    except ForeignPolicyError:
        raise
    except Exception as error:  # protobuf's and onnx's errors have no base of their own
        raise ForeignPolicyError(describe_refusal(onnx, error)) from error
    return model


def _load_weights(model: ModelProto, folder: Path) -> None:
    """Read weights that lie in other files of the same folder."""
    from onnx import TensorProto, external_data_helper

    tensors = [
        tensor
        for tensor in model.graph.initializer
        if external_data_helper.uses_external_data(tensor)
    ]
    names = {
        entry.value
        for tensor in tensors
        for entry in tensor.external_data
        if entry.key == "location"
    }
    for name in names:
        if not name or Path(name).name != name:
            raise ForeignPolicyError(f"its weights are in '{name:.60}', expected a file beside it")
        try:
            check_file(folder / name, MAX_BYTES)
        except (OSError, ValueError) as error:
            raise ForeignPolicyError(f"its weights in {name}: {describe(error)}") from error
    size = 0
    for tensor in tensors:
        external_data_helper.load_external_data_for_tensor(tensor, str(folder))
        size += len(tensor.raw_data)
        if size > MAX_BYTES:  # many tensors may name the same bytes of a file
            raise ForeignPolicyError(f"its weights have more than {MAX_BYTES} bytes")
        tensor.data_location = TensorProto.DEFAULT
        del tensor.external_data[:]


def _measure(model: ModelProto, metadata: dict[str, str]) -> NetworkShape:
    """Measure the one input and the one output of a network."""
    constants = {each.name for each in model.graph.initializer}
    inputs = [each for each in model.graph.input if each.name not in constants]
    for what, values in (("input", inputs), ("output", list(model.graph.output))):
        if len(values) != 1:
            named = ", ".join(value.name for value in values) or "none"
            raise ForeignPolicyError(
                f"its network has {len(values)} {what}s ({named}), expected one: export it without "
                "memory, values or a motion of its own"
            )
    sizes = [_measure_vector(value) for value in (inputs[0], model.graph.output[0])]
    return NetworkShape(metadata=metadata, observation=sizes[0], action=sizes[1])


def _measure_vector(value: Any) -> int:
    from onnx import TensorProto

    tensor = value.type.tensor_type
    kinds = {number: name.lower() for name, number in TensorProto.DataType.items()}
    if (kind := kinds.get(tensor.elem_type, "of no type")) != "float":
        raise ForeignPolicyError(
            f"'{value.name}' of its network is {kind}, expected 32-bit float: export it so"
        )
    sizes = [dim.dim_value for dim in tensor.shape.dim]
    if len(sizes) != 2 or sizes[0] not in (0, 1) or sizes[1] < 1:
        raise ForeignPolicyError(
            f"'{value.name}' of its network has shape {sizes}, expected (N, size)"
        )
    return sizes[1]
