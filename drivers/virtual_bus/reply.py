"""Bytes on their way from a device to the client."""

from __future__ import annotations

from typing import NamedTuple


class Reply(NamedTuple):
    """Bytes that a device puts on the wire: a frame, or its part of a fast one."""

    device: int
    """Its id."""
    delay: float
    """Silence before them [s], since the end of the instruction or of the reply before."""
    data: bytes
    hold: float = 0.0
    """How long the adapter holds them back [s]."""
