"""Policy files: ONNX models that carry a contract, and a checksum of all their bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from robots.files import read_bounded, write_atomically

CONTRACT_KEY = "policy_contract"  # of the contract in the model's metadata
CHECKSUM_KEY = "policy_sha256"  # of the checksum of everything else in the file
MAX_BYTES = 64 * 2**20

# Fields of ONNX's ModelProto and StringStringEntryProto, and wire types of protocol buffers.
METADATA_PROPS, ENTRY_KEY, ENTRY_VALUE = 14, 1, 2
VARINT, FIXED64, LENGTH_DELIMITED, FIXED32 = 0, 1, 2, 5


class NetworkError(ValueError):
    """A file does not hold a network that can be run; the message is one line."""


def read_policy_file(file: Path) -> tuple[bytes, str]:
    """Read a policy file and compare its checksum; return the model and the contract's text.

    Raises:
        OSError: if it cannot be read.
        NetworkError: if it is not ONNX, has no contract, or its checksum is missing or wrong.
    """
    try:
        model = read_bounded(file, MAX_BYTES)
        metadata = _read_metadata(model)
    except ValueError as error:
        raise NetworkError(f"it is not a complete ONNX file: {error}") from error
    if CONTRACT_KEY not in metadata:
        raise NetworkError("it has no policy contract: export it with `getup export`")
    if CHECKSUM_KEY not in metadata:
        raise NetworkError(
            "it has no checksum: export it again with `getup export`, or, if you trust it, add "
            "one with humanoid_getup.policy.onnx_file.add_checksum(file)"
        )
    if metadata[CHECKSUM_KEY] != _compute_checksum(model):
        raise NetworkError("it is damaged: its content does not match its checksum")
    return model, metadata[CONTRACT_KEY]


def seal_model(model: bytes, contract: str) -> bytes:
    """Return an ONNX model with a contract and the checksum of both in its metadata."""
    model = _drop_metadata(model, {CONTRACT_KEY, CHECKSUM_KEY})
    model += _encode_entry(CONTRACT_KEY, contract)
    return model + _encode_entry(CHECKSUM_KEY, _compute_checksum(model))


def add_checksum(file: Path) -> None:
    """Give a policy file of contract format 4 its checksum, which makes it format 5.

    Only the metadata changes: the network stays the same to the last bit.
    """
    model = file.read_bytes()
    contract = _read_metadata(model)[CONTRACT_KEY]
    write_atomically(file, seal_model(model, contract.replace('"format": 4', '"format": 5', 1)))


def _compute_checksum(model: bytes) -> str:
    return hashlib.sha256(_drop_metadata(model, {CHECKSUM_KEY})).hexdigest()


def _read_metadata(model: bytes) -> dict[str, str]:
    metadata: dict[str, str] = {}
    for field, _, value in _split_fields(model):
        if field == METADATA_PROPS:
            key, text = _decode_entry(value)
            if key in metadata:
                raise ValueError(f"its metadata holds '{key}' twice")
            metadata[key] = text
    return metadata


def _drop_metadata(model: bytes, keys: set[str]) -> bytes:
    return b"".join(
        whole
        for field, whole, value in _split_fields(model)
        if field != METADATA_PROPS or _decode_entry(value)[0] not in keys
    )


def _encode_entry(key: str, text: str) -> bytes:
    def encode(field: int, value: bytes) -> bytes:
        return bytes([field << 3 | LENGTH_DELIMITED]) + _encode_varint(len(value)) + value

    entry = encode(ENTRY_KEY, key.encode()) + encode(ENTRY_VALUE, text.encode())
    return encode(METADATA_PROPS, entry)


def _decode_entry(entry: bytes) -> tuple[str, str]:
    values = {field: value for field, _, value in _split_fields(entry)}
    return values.get(ENTRY_KEY, b"").decode(), values.get(ENTRY_VALUE, b"").decode()


def _split_fields(message: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Split a protocol buffer into its fields: number, all bytes, and bytes of the value."""
    at = 0
    while at < len(message):
        start = at
        tag, at = _decode_varint(message, at)
        field, wire_type = tag >> 3, tag & 7
        size = {FIXED64: 8, FIXED32: 4}.get(wire_type)
        if wire_type == VARINT:
            size = _decode_varint(message, at)[1] - at
        elif wire_type == LENGTH_DELIMITED:
            size, at = _decode_varint(message, at)
        if field == 0 or size is None or at + size > len(message):
            raise ValueError(f"byte {start} does not begin a field")
        yield field, message[start : at + size], message[at : at + size]
        at += size


def _encode_varint(value: int) -> bytes:
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*encoded, value])


def _decode_varint(message: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 64, 7):
        if at >= len(message):
            break
        value |= (message[at] & 0x7F) << shift
        at += 1
        if message[at - 1] < 0x80:
            return value, at
    raise ValueError(f"it ends, or has a number without end, at byte {at}")
