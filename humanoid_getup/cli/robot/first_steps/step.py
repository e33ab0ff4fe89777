"""A step of the first connection: a command, and what a person does before it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FirstStep:
    """A command of `getup` that belongs to the first connection."""

    name: str
    """Name by which it is kept as done, and chosen by --step."""
    aim: str
    """What it is for, as a sentence."""
    words: tuple[str, ...]
    """The command line, without "getup"."""
    before: str = ""
    """What a person does before, as a sentence."""
    at_bus: str = ""
    """What is typed at a virtual bus instead."""
    asks: str = ""
    """Question for a last word of the command; without an answer the step is skipped."""
    is_optional: bool = False
    """Whether it may be skipped."""
