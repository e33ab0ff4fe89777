"""Numbers of a URDF: all are checked before any is used, and all problems reported."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator

from robots.model_import.source import MOST_INERTIA, find_range_problems
from robots.storage.validation import shown

IN_RADIANS = "limits of a URDF are in rad"
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
COUNTS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(INERTIA, 1),
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
"""Count of numbers in the attributes of an element."""


def read_number(element: ET.Element | None, key: str, default: float = 0.0) -> float:
    """Return the number of a checked attribute, or a default."""
    return default if element is None else float(element.get(key, default))


def find_value_problems(root: ET.Element) -> list[str]:
    """Find names that stand twice, texts that are not numbers, and impossible numbers."""
    problems = []
    for kind in ("link", "joint"):
        names = Counter(owner.get("name") for owner in root.findall(kind))
        problems += [
            f"{count} {kind}s are named {shown(name)}, expected a name of its own for each"
            for name, count in names.items()
            if name and count > 1
        ]
        for number, owner in enumerate(root.findall(kind), start=1):
            name = owner.get("name")
            where = f"{kind} {shown(name) if name else f'number {number}'}"
            unread = [f"{where}: {text}" for text in _find_unread(owner)]
            problems += unread or [f"{where} {text}" for text in _find_impossible(owner, root)]
    return problems


def _find_unread(owner: ET.Element) -> Iterator[str]:
    """Find attributes that do not hold the expected finite numbers."""
    for element in owner.iter():
        for key, count in COUNTS.get(element.tag, {}).items():
            text = element.get(key)
            if text is not None and not _holds(text, count):
                what = "a finite number" if count == 1 else f"{count} finite numbers"
                yield f"{key} of <{element.tag}> is {shown(text)}, expected {what}"


def _holds(text: str, count: int) -> bool:
    """Tell whether MuJoCo would read the expected count of finite numbers in a text."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return False
    is_plain = text.isascii() and "_" not in text
    return is_plain and len(numbers) == count and all(map(math.isfinite, numbers))


def _find_impossible(owner: ET.Element, root: ET.Element) -> Iterator[str]:
    """Find values that no link or joint can have."""
    mass, limit, mimic = owner.find("inertial/mass"), owner.find("limit"), owner.find("mimic")
    if (heavy := read_number(mass, "value")) < 0.0:
        yield f"has a mass of {heavy:g} kg, expected 0 kg or more"
    for key in INERTIA:
        moment = read_number(owner.find("inertial/inertia"), key)
        if abs(moment) > MOST_INERTIA:
            yield f"has {key} of {moment:g} kg·m², expected at most {MOST_INERTIA:g} kg·m²"
    for key, unit in (("effort", "N·m"), ("velocity", "rad/s")):
        if (most := read_number(limit, key)) < 0.0:
            yield f"has a limit of {key} of {most:g} {unit}, expected 0 {unit} or more"
    if owner.get("type") == "revolute":
        lower, upper = read_number(limit, "lower"), read_number(limit, "upper")
        yield from find_range_problems(lower, upper, IN_RADIANS)
    if mimic is not None:
        others = [joint.get("name") for joint in root.findall("joint") if joint is not owner]
        if mimic.get("joint") not in others:
            yield (
                f"mimics {shown(mimic.get('joint'))}, expected another joint: "
                f"{', '.join(name for name in others if name)}"
            )
