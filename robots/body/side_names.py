"""Joint names that state a side: l_hip_pitch, left-hip, LHipPitch, hipPitchL."""

from __future__ import annotations

import re

WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
LEFT, RIGHT = ("l", "left"), ("r", "right")
OPPOSITE = dict(zip(LEFT + RIGHT, RIGHT + LEFT, strict=True))


def swap_side(name: str) -> str:
    """Return the name of a part's counterpart: "left_knee" for "right_knee", "LKnee" for "RKnee".

    A name that says no side is returned as it is.
    """
    word = next((w for w in WORD.finditer(name) if w.group().lower() in OPPOSITE), None)
    if word is None:
        return name
    other = OPPOSITE[word.group().lower()]
    text = word.group()
    other = other.capitalize() if text[0].isupper() else other
    other = other.upper() if text.isupper() and len(text) > 1 else other
    return name[: word.start()] + other + name[word.end() :]


def side_of(name: str) -> int:
    """Return 1 if a name states left, -1 if it states right, else 0."""
    words = [w.group().lower() for w in WORD.finditer(name)]
    said = next((word for word in words if word in OPPOSITE), "")
    return int(said in LEFT) - int(said in RIGHT)


def remove_side(left: str, right: str) -> str:
    """Remove the side from the name of a left joint, if it has one."""
    side = find_side(left, right)
    if side is None:
        return left
    start, word = side
    before, after = left[:start], left[start + len(word) :]
    return before + after.lstrip("_-.") if after else before.rstrip("_-.")


def find_side(a: str, b: str) -> tuple[int, str] | None:
    """Find the one word, in lower case, and its place in ``a``, that tells a pair's sides."""
    words, others = list(WORD.finditer(a)), list(WORD.finditer(b))
    if len(words) != len(others):
        return None
    differ = [
        (word, other.group().lower())
        for word, other in zip(words, others, strict=True)
        if word.group() != other.group()
    ]
    if len(differ) != 1:
        return None
    word, other = differ[0][0].group().lower(), differ[0][1]
    is_all = len(word) == len(a)  # a joint named "l" has no other name
    return None if OPPOSITE.get(word) != other or is_all else (differ[0][0].start(), word)
