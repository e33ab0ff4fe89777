"""Policy files: ONNX models that end with a checksum of all their other bytes.

A model is read as protocol buffers before it is run. Field numbers are those of ``onnx.proto``. A
message is a row of fields; each has a number, and here either a number as its value or bytes, which
may be a message again.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from robots.storage.files import read_bounded

GRAPH, METADATA, FUNCTION = 7, 14, 25  # of a model
KEY, VALUE = 1, 2  # of an entry of its metadata
NODE, INITIALIZER, SPARSE_INITIALIZER = 1, 5, 15  # of a graph
ATTRIBUTE = 5  # of a node
TENSOR, SUBGRAPH, TENSORS, SUBGRAPHS, SPARSE_TENSOR, SPARSE_TENSORS = 5, 6, 10, 11, 22, 23
"""Of an attribute."""
SPARSE_PARTS = (1, 2)  # of a sparse tensor: values and indices, which are tensors
EXTERNAL_DATA, DATA_LOCATION = 13, 14  # of a tensor

EXTERNAL_WEIGHTS = "its weights are in another file, expected all in this one"

VARINT, FIXED_64, BYTES, FIXED_32 = 0, 1, 2, 5  # wire types
FIXED_SIZES = {FIXED_64: 8, FIXED_32: 4}


def find_content_problems(model: bytes) -> list[str]:
    """List content that a policy must not have: control flow, functions, data in other files.

    Without control flow, the time of an inference does not depend on the observation.
    """
    whole = memoryview(model)
    if not _has(whole, GRAPH):
        raise ValueError("it holds no network")
    attributes = [*_select(whole, GRAPH, NODE, ATTRIBUTE)]
    problems = []
    if any(_has(attribute, SUBGRAPH, SUBGRAPHS) for attribute in attributes):
        problems.append("the network has loops or branches, expected none")
    if _has(whole, FUNCTION):
        problems.append("the model has functions, expected none")
    if any(_is_external(tensor) for tensor in _list_tensors(whole, attributes)):
        problems.append(EXTERNAL_WEIGHTS)
    return problems


def read_metadata(model: bytes) -> dict[str, str]:
    """Read the metadata of a model."""
    found = {}
    for entry in _select(memoryview(model), METADATA):
        texts = {field: bytes(v) for field, v in _read_fields(entry) if isinstance(v, memoryview)}
        found[texts.get(KEY, b"").decode()] = texts.get(VALUE, b"").decode()
    return found


def _list_tensors(model: memoryview, attributes: list[memoryview]) -> Iterator[memoryview]:
    yield from _select(model, GRAPH, INITIALIZER)
    sparse = [*_select(model, GRAPH, SPARSE_INITIALIZER)]
    for attribute in attributes:
        for field in (TENSOR, TENSORS):
            yield from _select(attribute, field)
        for field in (SPARSE_TENSOR, SPARSE_TENSORS):
            sparse += _select(attribute, field)
    for tensor in sparse:
        for part in SPARSE_PARTS:
            yield from _select(tensor, part)


def _is_external(tensor: memoryview) -> bool:
    fields = [*_read_fields(tensor)]
    return any(field == EXTERNAL_DATA or (field == DATA_LOCATION and v) for field, v in fields)


def _has(message: memoryview, *fields: int) -> bool:
    return any(field in fields for field, _ in _read_fields(message))


def _select(message: memoryview, field: int, *path: int) -> Iterator[memoryview]:
    """Yield every message at a path of fields."""
    for found, value in _read_fields(message):
        if found == field and isinstance(value, memoryview):
            yield from _select(value, *path) if path else [value]


def _read_fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Yield number and value of every field."""
    at = 0
    while at < len(message):
        tag, at = _read_varint(message, at)
        field, wire_type = tag >> 3, tag & 7
        if wire_type == VARINT:
            value, at = _read_varint(message, at)
            yield field, value
            continue
        if wire_type == BYTES:
            size, at = _read_varint(message, at)
        elif wire_type in FIXED_SIZES:
            size = FIXED_SIZES[wire_type]
        else:
            raise ValueError(f"field {field} has wire type {wire_type}")
        if at + size > len(message):
            raise ValueError(f"field {field} has {size} bytes, {len(message) - at} are left")
        yield field, message[at : at + size]
        at += size


def _read_varint(message: memoryview, at: int) -> tuple[int, int]:
    """Read a number of 7 bits a byte, lowest first; return it and its end."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            raise ValueError("it ends within a number")
        byte, at = message[at], at + 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("a number has more than 10 bytes")


CONTRACT_KEY = "policy_contract"  # of the contract in the model's metadata
CHECKSUM_KEY = "policy_sha256"  # of the checksum there
MAX_BYTES = 64 * 2**20

# A model is a protocol buffer, to which an entry of its metadata may be appended: field 14
# (0x72) of 81 bytes, in which field 1 (0x0a) is the key and field 2 (0x12) the value.
CHECKSUM_ENTRY = b"\x72\x51\x0a\x0d" + CHECKSUM_KEY.encode() + b"\x12\x40"


class NetworkError(ValueError):
    """A file does not hold a network that can be run; the message is one line."""


def read_model(file: Path) -> bytes:
    """Read a policy file and compare its checksum."""
    try:
        content = read_bounded(file, MAX_BYTES)
    except ValueError as error:
        raise NetworkError(f"it is not an ONNX file: {error}") from error
    model, entry, checksum = content.rpartition(CHECKSUM_ENTRY)
    if CONTRACT_KEY.encode() not in content:
        raise NetworkError(
            "it is not a complete ONNX file, or has no policy contract: export it with "
            "`getup export`"
        )
    if not entry:
        raise NetworkError("it is damaged, or has no checksum: export it again with `getup export`")
    if checksum != _compute_checksum(model):
        raise NetworkError("it is damaged: its content does not match its checksum")
    try:
        problems = find_content_problems(content)
    except ValueError as error:
        raise NetworkError(f"it is not a complete ONNX file: {error}") from error
    if problems:
        raise NetworkError("; ".join(problems))
    return content


def describe_refusal(library: ModuleType, error: Exception) -> str:
    """Say in one line why a library does not take a whole model, such as a newer one."""
    name, reason = library.__name__, " ".join(str(error).split()).rstrip(".")
    reason = re.sub(r"^\[ONNX.*? : [A-Z_]+ : (/\S+ .*\) (?=[A-Z]))?", "", reason)  # the place
    return (
        f"{name} {library.__version__} cannot load it: {reason}; expected what this version knows: "
        f"export it with an older IR version or opset, or update {name}"
    )


def seal_model(model: bytes) -> bytes:
    """Append the checksum of an ONNX model to its metadata."""
    return model + CHECKSUM_ENTRY + _compute_checksum(model)


def _compute_checksum(model: bytes) -> bytes:
    return hashlib.sha256(model).hexdigest().encode()
