"""One way to write results as JSON: dataclasses, `msgspec` structures, arrays and plain values."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

import msgspec


def to_json(value: Any) -> str:
    """Write a value as indented JSON text; numbers that are not finite become null."""
    return msgspec.json.format(_encode(value), indent=1).decode() + "\n"


def to_json_line(value: Any) -> bytes:
    """Write a value as one line of JSON Lines."""
    return _encode(value) + b"\n"


def to_plain(value: Any) -> Any:
    """Return a value as dictionaries, lists, texts and numbers."""
    return msgspec.to_builtins(value, enc_hook=_simplify, str_keys=True)


def as_kept(value: Any) -> Any:
    """Return a value as it would be after JSON."""
    return msgspec.json.decode(to_json(value))


def _encode(value: Any) -> bytes:
    try:
        return msgspec.json.encode(value, enc_hook=_simplify)
    except UnicodeEncodeError:  # the name of a file that is not UTF-8
        return msgspec.json.encode(_replace_surrogates(to_plain(value)))


def _simplify(value: Any) -> Any:
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        return value.tolist()
    if isinstance(value, PurePath):
        return str(value)
    raise NotImplementedError(f"{type(value).__name__} cannot be written as JSON")


def _replace_surrogates(value: Any) -> Any:
    if isinstance(value, dict):
        return {_replace_surrogates(key): _replace_surrogates(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_replace_surrogates(item) for item in value]
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else value
