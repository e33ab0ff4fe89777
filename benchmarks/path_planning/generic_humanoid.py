"""Humanoids of one shape with as many joints as asked for: robot folders made from a table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from path_planning.humanoid_links import LINKS, HumanoidHinge, HumanoidLink
from robots import Robot, load_robot

JOINT_COUNTS = (20, 30, 49)
"""Numbers of joints that a humanoid can have."""
SIDES = (("l_", 1.0), ("r_", -1.0))
AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
SITES = {"pelvis": ("imu", "0 0 0"), "chest": ("neck", "0 0 0.1"), "foot": ("sole", "0 0 -0.032")}
"""Of a link: name and place."""
SERVO = "XM430-W350"
DENSITY = "800"  # kg/m³


def make_humanoid(joints: int, folder: Path) -> Robot:
    """Write a humanoid, as tall as OP3, into an empty folder, and load it.

    Its shapes are the same with any number of joints; with fewer, the waist is stiff, and the
    hands and toes.

    Args:
        joints: One of `JOINT_COUNTS`.
        folder: Folder that exists, for robot.toml and model.xml.
    """
    (folder / "model.xml").write_text(_write_model(joints), "utf-8")
    (folder / "robot.toml").write_text(_write_description(joints), "utf-8")
    return load_robot(folder)


def _write_model(joints: int) -> str:
    root = ElementTree.Element("mujoco", model=f"humanoid_{joints}")
    ElementTree.SubElement(root, "compiler", angle="degree")
    ElementTree.SubElement(root, "option", timestep="0.002", integrator="implicitfast")
    bodies = {"": ElementTree.SubElement(root, "worldbody")}
    for link in LINKS:
        for prefix, side in SIDES if link.is_paired else (("", 1.0),):
            parent = bodies.get(prefix + link.parent, bodies.get(link.parent))
            assert parent is not None
            at = (link.at[0], side * link.at[1], link.at[2])
            body = ElementTree.SubElement(parent, "body", name=prefix + link.name, pos=_row(*at))
            bodies[prefix + link.name] = body
            _fill_body(body, link, prefix, joints)
    return ElementTree.tostring(root, encoding="unicode")


def _fill_body(body: ElementTree.Element, link: HumanoidLink, prefix: str, joints: int) -> None:
    if not link.parent:
        ElementTree.SubElement(body, "freejoint", name="root")
    for hinge in link.hinges:
        if hinge.least <= joints:
            flips = prefix == "r_" and hinge.axis != "y"
            limits = (-hinge.upper, -hinge.lower) if flips else (hinge.lower, hinge.upper)
            name, axis = prefix + hinge.name, AXES[hinge.axis]
            ElementTree.SubElement(body, "joint", name=name, axis=axis, range=_row(*limits))
    kind = "box" if len(link.half_size) == 3 else "capsule"
    size, pos = _row(*link.half_size), _row(*link.center)
    name = prefix + link.name
    ElementTree.SubElement(body, "geom", name=name, type=kind, size=size, pos=pos, density=DENSITY)
    if link.name in SITES:
        site, pos = SITES[link.name]
        ElementTree.SubElement(body, "site", name=prefix + site, pos=pos)


def _write_description(joints: int) -> str:
    rows = [
        f'  {{ name = "{name}", id = {number}, servo = "{SERVO}", sign = 1, zero_ticks = 2048, '
        f'mirror = "{mirror}", mirror_sign = {1 if hinge.axis == "y" else -1}, '
        f'segment = "{hinge.segment}" }},'
        for number, (name, mirror, hinge) in enumerate(_list_joints(joints), 1)
    ]
    return "\n".join(
        [
            f'name = "humanoid_{joints}"',
            'model = "model.xml"',
            'torso = "pelvis"',
            'neck_site = "neck"',
            'imu_site = "imu"',
            'sole_sites = ["l_sole", "r_sole"]',
            "control_period = 0.008",
            "supply_voltage = 12.0",
            "joints = [",
            *rows,
            "]",
            "[standing]",
            "",
        ]
    )


def _list_joints(joints: int) -> Iterator[tuple[str, str, HumanoidHinge]]:
    """List the name of each joint, that of its mirror image, and the hinge."""
    for link in LINKS:
        for hinge in link.hinges:
            if hinge.least > joints:
                continue
            if link.is_paired:
                yield f"l_{hinge.name}", f"r_{hinge.name}", hinge
                yield f"r_{hinge.name}", f"l_{hinge.name}", hinge
            else:
                yield hinge.name, hinge.name, hinge


def _row(*numbers: float) -> str:
    return " ".join(f"{number:g}" for number in numbers)
