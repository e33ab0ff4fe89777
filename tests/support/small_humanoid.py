"""A small humanoid of boxes, as a plain model file: MJCF or URDF."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from robots import quaternion
from robots.quaternion import Array

X, Y, Z = np.eye(3)
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])
HINGE, BOX = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtGeom.mjGEOM_BOX


@dataclass(frozen=True)
class Part:
    """A link with its hinge; left ones have a mirror image."""

    name: str
    parent: str
    anchor: tuple[float, float, float]
    """In the torso's frame with all angles 0: x forward, y left [m]."""
    axis: Array
    range: tuple[float, float]
    """[deg]"""
    box: tuple[float, float, float]
    """Half sizes [m]; 0 for a link that is only a hinge."""
    center: tuple[float, float, float]
    """Of the box, from the anchor [m]."""
    mass: float


# Hip 0.3 m above the sole, shoulder 0.2 m above the hip; feet 3 cm longer in front of the ankle.
LEFT = (
    Part("hip_yaw", "torso", (0, 0.05, 0), Z, (-60, 60), (0.02, 0.02, 0.01), (0, 0, 0), 0.05),
    Part("hip_roll", "hip_yaw", (0, 0.05, 0), X, (-20, 60), (0.02, 0.02, 0.01), (0, 0, 0), 0.05),
    Part("thigh", "hip_roll", (0, 0.05, 0), Y, (-110, 40), (0.02, 0.02, 0.05), (0, 0, -0.07), 0.2),
    Part("shank", "thigh", (0, 0.05, -0.14), Y, (0, 140), (0.02, 0.02, 0.05), (0, 0, -0.07), 0.15),
    Part("ankle", "shank", (0, 0.05, -0.27), Y, (-60, 60), (0.01, 0.01, 0.01), (0, 0, 0), 0.03),
    Part("foot", "ankle", (0, 0.05, -0.27), X, (-40, 40), (0.06, 0.035, 0.005),
         (0.015, 0, -0.025), 0.05),
    Part("shoulder", "torso", (0, 0.1, 0.2), Y, (-170, 170), (0.01, 0.01, 0.01), (0, 0, 0), 0.03),
    Part("upper_arm", "shoulder", (0, 0.1, 0.2), X, (-10, 170), (0.015, 0.015, 0.04),
         (0, 0.01, -0.06), 0.08),
    Part("forearm", "upper_arm", (0, 0.11, 0.1), Y, (-130, 5), (0.015, 0.015, 0.04),
         (0, 0, -0.05), 0.06),
)  # fmt: skip
HEAD = Part("head", "torso", (0, 0, 0.24), Z, (-90, 90), (0.04, 0.04, 0.04), (0, 0, 0.05), 0.1)
TORSO_BOX, TORSO_CENTER, TORSO_MASS = (0.04, 0.06, 0.1), (0.0, 0.0, 0.12), 1.0
PAIRS = tuple(part.name for part in LEFT)


def list_parts() -> list[tuple[str, Part, float]]:
    """List all links: name, left part, and 1 for left and middle, -1 for right."""
    parts = [(f"left_{part.name}", part, 1.0) for part in LEFT]
    parts += [(f"right_{part.name}", part, -1.0) for part in LEFT]
    return [*parts, ("head", HEAD, 1.0)]


def small_humanoid(
    *,
    rename: Callable[[str], str] = str,
    position: tuple[float, float, float] = (0.0, 0.0, 0.31),
    yaw: float = 0.0,
    frame: Array = NO_TURN,
    change: Callable[[mujoco.MjSpec], object] = lambda _: None,
) -> str:
    """Write the small humanoid as MJCF.

    Args:
        rename: Makes the names of joints and links.
        position: Of its torso [m].
        yaw: Direction that it faces [rad].
        frame: Turn of the torso's own frame, which does not move anything.
        change: Changes the model.
    """
    spec = mujoco.MjSpec()
    back = quaternion.inverse(frame)
    turned = quaternion.multiply(quaternion.from_yaw(yaw), frame)
    torso = spec.worldbody.add_body(name=rename("torso"), pos=position, quat=turned.tolist())
    torso.add_freejoint()
    _add_box(torso, TORSO_BOX, quaternion.rotate(back, np.array(TORSO_CENTER)), TORSO_MASS, back)
    built, origins = {"torso": torso}, {"torso": np.zeros(3)}
    for name, part, side in list_parts():
        flip = np.array([1.0, side, 1.0])
        anchor = np.array(part.anchor) * flip
        above = part.parent if part.parent == "torso" else f"{name.split('_')[0]}_{part.parent}"
        offset = anchor - origins[above]
        is_first = above == "torso"
        body = built[above].add_body(
            name=rename(name),
            pos=(quaternion.rotate(back, offset) if is_first else offset).tolist(),
            quat=(back if is_first else NO_TURN).tolist(),
        )
        body.add_joint(
            name=rename(f"{name}_joint"),
            type=HINGE,
            axis=part.axis.tolist(),
            range=_range(part, side),
        )
        _add_box(body, part.box, np.array(part.center) * flip, part.mass)
        built[name], origins[name] = body, anchor
    change(spec)
    spec.compile()
    return spec.to_xml()


def _range(part: Part, side: float) -> list[float]:
    """Return the range of a hinge [deg]; a right hinge about x or z turns the other way."""
    lower, upper = part.range
    return [lower, upper] if side > 0.0 or part.axis is Y else [-upper, -lower]


def _add_box(
    body: mujoco.MjsBody,
    size: tuple[float, float, float],
    center: Array,
    mass: float,
    orientation: Array = NO_TURN,
) -> None:
    pose = {"pos": center.tolist(), "quat": orientation.tolist()}
    body.add_geom(type=BOX, size=size, mass=mass, **pose)


def small_urdf(*, scale: float = 1.0, angle: float = np.pi / 180.0, mesh: str = "") -> str:
    """Write it as URDF, without torso joint; lengths in 1/``scale`` m, angles of ``angle`` rad."""
    links = [_write_link("torso", TORSO_BOX, np.array(TORSO_CENTER), TORSO_MASS, scale, mesh)]
    joints, origins = [], {"torso": np.zeros(3)}
    for name, part, side in list_parts():
        flip = np.array([1.0, side, 1.0])
        origins[name] = np.array(part.anchor) * flip
        above = part.parent if part.parent == "torso" else f"{name.split('_')[0]}_{part.parent}"
        links.append(_write_link(name, part.box, np.array(part.center) * flip, part.mass, scale))
        lower, upper = (angle * value for value in _range(part, side))
        joints.append(
            f'<joint name="{name}_joint" type="revolute"><parent link="{above}"/>'
            f'<child link="{name}"/><axis xyz="{_text(part.axis)}"/>'
            f'<origin xyz="{_text(scale * (origins[name] - origins[above]))}"/>'
            f'<limit lower="{lower}" upper="{upper}" effort="4.1" velocity="4.8"/></joint>'
        )
    return f'<robot name="small">{"".join([*links, *joints])}</robot>'


def _write_link(
    name: str,
    box: tuple[float, float, float],
    center: Array,
    mass: float,
    scale: float,
    mesh: str = "",
) -> str:
    shape = (
        f'<mesh filename="{mesh}"/>'
        if mesh
        else f'<box size="{_text(2 * scale * np.array(box))}"/>'
    )
    origin = f'<origin xyz="{_text(scale * center)}"/>'
    inertia = "".join(f' i{a}{a}="{1e-4 * scale**2}"' for a in "xyz") + ' ixy="0" ixz="0" iyz="0"'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f"<inertia{inertia}/></inertial>"
        f"<collision>{origin}<geometry>{shape}</geometry></collision></link>"
    )


def _text(values: Array) -> str:
    return " ".join(f"{value:g}" for value in values)
