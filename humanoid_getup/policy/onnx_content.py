"""The content of an ONNX model, read as protocol buffers before the model is run.

Field numbers are those of ``onnx.proto``. A message is a row of fields; each has a number, and
here either a number as its value or bytes, which may be a message again.
"""

from __future__ import annotations

from collections.abc import Iterator

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

    Raises:
        ValueError: if the model is not a protocol buffer, or has no network.
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
    """Read the metadata of a model.

    Raises:
        ValueError: if the model is not a protocol buffer with texts for metadata.
    """
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
