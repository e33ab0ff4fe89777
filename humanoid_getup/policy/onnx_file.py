"""Policy files: ONNX models that end with a checksum of all their other bytes."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from types import ModuleType

from humanoid_getup.policy.onnx_content import find_content_problems
from robots.storage.files import read_bounded

CONTRACT_KEY = "policy_contract"  # of the contract in the model's metadata
CHECKSUM_KEY = "policy_sha256"  # of the checksum there
MAX_BYTES = 64 * 2**20

# A model is a protocol buffer, to which an entry of its metadata may be appended: field 14
# (0x72) of 81 bytes, in which field 1 (0x0a) is the key and field 2 (0x12) the value.
CHECKSUM_ENTRY = b"\x72\x51\x0a\x0d" + CHECKSUM_KEY.encode() + b"\x12\x40"


class NetworkError(ValueError):
    """A file does not hold a network that can be run; the message is one line."""


def read_model(file: Path) -> bytes:
    """Read a policy file and compare its checksum.

    Raises:
        OSError: if it cannot be read.
        NetworkError: if it is larger than `MAX_BYTES`, has no contract, its checksum is missing
            or wrong, or it has loops, functions or weights in other files.
    """
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
