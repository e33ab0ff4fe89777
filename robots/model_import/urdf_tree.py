"""Joints of a URDF: they have to make a tree of its links, with the torso at its root."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

from robots.storage.validation import shown


def find_tree_problems(root: ET.Element) -> Iterator[str]:
    """Find joints that do not make a tree of the links: of unknown links, or in a loop."""
    links = {link.get("name", ""): list[str]() for link in root.findall("link")}
    below: dict[str, list[str]] = {name: [] for name in links}
    for number, joint in enumerate(root.findall("joint"), start=1):
        name = shown(joint.get("name")) if joint.get("name") else f"number {number}"
        ends = [joint.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        if not {parent, child} <= links.keys():
            yield f"joint {name} joins {shown(parent)} and {shown(child)}, expected two links"
            continue
        links[child].append(name)
        below[parent].append(child)
    for link, joints in links.items():
        if len(joints) > 1:
            yield (
                f"link {shown(link)} hangs on joints {' and '.join(joints)}, expected one: open "
                "the loop that they close"
            )
    reached = [link for link, joints in links.items() if not joints]
    for link in reached:  # which grows
        reached += [child for child in below[link] if child not in reached]
    if lost := [link for link in links if link not in reached]:
        yield (
            f"links {', '.join(map(shown, lost))} hang on each other in a loop, expected a torso "
            "that hangs on none: remove a joint between them"
        )
