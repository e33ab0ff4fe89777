"""Proportions of a robot: factors on the lengths of its parts."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

from robots.arguments import expect
from robots.storage.validation import shown

MIN_FACTOR, MAX_FACTOR = 0.25, 4.0


class BodyError(ValueError):
    """A body cannot be described or built; the message is one line."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """Lengths of a robot's parts, as factors on those of its model.

    Mass follows length, and inertia follows both; servos stay the same.
    """

    shoulders: float = 1.0
    """Distance of the arms from the midline."""
    arms: float = 1.0
    """Length of every link of the arms."""
    torso: float = 1.0
    """Height of the torso above the hips."""
    legs: float = 1.0
    """Length of every link of the legs."""

    def __post_init__(self) -> None:
        for part, factor in self:
            expect(f"body: {part}", factor, int | float, "a factor")
            if not MIN_FACTOR <= factor <= MAX_FACTOR:
                raise BodyError(
                    f"body: {part} is {factor:g}, expected a factor from {MIN_FACTOR:g} to "
                    f"{MAX_FACTOR:g}"
                )

    def __iter__(self) -> Iterator[tuple[str, float]]:
        """Return the parts and their factors."""
        return ((part, getattr(self, part)) for part in PARTS)

    def __str__(self) -> str:
        """Return the text from which :meth:`parse` makes this body; empty for the original."""
        return ",".join(f"{part}={factor!r}" for part, factor in self if factor != 1.0)

    @property
    def is_original(self) -> bool:
        """Return whether every factor is 1."""
        return all(factor == 1.0 for _, factor in self)

    @classmethod
    def parse(cls, text: str) -> Body:
        """Make the body that a text such as ``arms=1.6,torso=2.2`` describes."""
        factors: dict[str, float] = {}
        problems: list[str] = []
        for item in text.split(",") if text.strip() else []:
            part, _, number = (word.strip() for word in item.partition("="))
            if part not in PARTS:
                problems.append(f"unknown part {shown(part)}, expected {', '.join(PARTS)}")
            elif part in factors:
                problems.append(f"{part} is given twice, expected once")
            else:
                factors[part] = math.nan  # outside every range
                with contextlib.suppress(ValueError):
                    factors[part] = float(number)
                if not MIN_FACTOR <= factors[part] <= MAX_FACTOR:
                    problems.append(
                        f"{part} is {shown(number)}, expected a factor from {MIN_FACTOR:g} to "
                        f"{MAX_FACTOR:g}"
                    )
        if problems:
            raise BodyError(f"body {shown(text)}: {'; '.join(dict.fromkeys(problems))}")
        return cls(**factors)


PARTS = tuple(field.name for field in fields(Body))
ORIGINAL = Body()
