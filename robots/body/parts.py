"""Parts of a body: which links are trunk, and where legs, arms and heads begin."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

import mujoco
import numpy as np

from robots.body.links import Link, LinkFrames, gather_links
from robots.robot import Robot, RobotError

BESIDE = 1e-3  # m from the middle of the torso, where a limb is on one side


@dataclass(frozen=True, eq=False)
class BodyParts:
    """Trunk and limbs of a body; each limb is given by its first link."""

    torso: Link
    trunk: list[Link] = field(default_factory=list)
    """Torso, pelvis, chest and what is between them; the torso first."""
    legs: list[tuple[Link, Link]] = field(default_factory=list)
    """Links of the trunk, and the first links of the legs that hang on them."""
    arms: list[tuple[Link, Link]] = field(default_factory=list)
    heads: list[tuple[Link, Link]] = field(default_factory=list)

    def find_spine(self, body: int) -> list[Link]:
        """Find the links from below the torso to the one that holds a body."""
        return _find_way(self.torso, body)[1:]


def sort_parts(
    torso: Link,
    *,
    is_foot: Callable[[Link], bool],
    is_head: Callable[[Link], bool],
    aside: Callable[[Link], float],
) -> BodyParts:
    """Sort the links that hang on a torso.

    Legs end in feet. What else hangs on the trunk is a head or an arm. A link that hangs on the
    trunk and carries several limbs is trunk, too, like a pelvis or a chest on a waist joint, and
    so are the links of a spine up to there. ``aside`` tells how far to the left of the middle a
    link's joint is [m].
    """
    parts = BodyParts(torso)

    def sort(trunk: Link) -> None:
        parts.trunk.append(trunk)
        for link in trunk.children:
            feet = _count_feet(link, is_foot)
            if feet > 1:
                sort(link)
            elif feet:
                parts.legs.append((trunk, link))
            elif is_head(link):
                parts.heads.append((trunk, link))
            elif _carries_limbs(link, aside):
                sort(link)
            else:
                parts.arms.append((trunk, link))

    sort(torso)
    return parts


def find_parts(
    model: mujoco.MjModel, torso: str, sole_sites: Collection[str], head_joints: Collection[str]
) -> BodyParts:
    """Find the parts of a model by its soles and the joints of its head, all joints at zero."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frames, root = LinkFrames(data), gather_links(model, model.body(torso).id)
    soles = {model.site(name).id for name in sole_sites}
    head = {model.joint(name).id for name in head_joints}
    return sort_parts(
        root,
        is_foot=lambda link: not soles.isdisjoint(link.sites),
        is_head=lambda link: {j for part in link.walk() for j in part.joints} <= head,
        aside=lambda link: float(frames.anchor_in(link, root)[1]),
    )


def find_robot_parts(robot: Robot, model: mujoco.MjModel) -> BodyParts:
    """Find the parts of a robot in a compiled model that holds it."""
    return find_parts(model, robot.torso, robot.sole_sites, list_head_joints(robot))


def find_arm_joints(robot: Robot, model: mujoco.MjModel) -> np.ndarray:
    """Find the joints of arms that a rise moves, (n,) of bool."""
    arms = {
        joint
        for _, arm in find_robot_parts(robot, model).arms
        for link in arm.walk()
        for joint in link.joints
    }
    rising = np.array([robot.joint_names.index(name) for name in robot.rising_joints], dtype=int)
    moved = np.zeros(robot.n, dtype=bool)
    moved[rising] = moved[robot.mirror_index[rising]] = True
    return moved & np.array([model.joint(name).id in arms for name in robot.joint_names])


def list_head_joints(robot: Robot) -> list[str]:
    """List the joints that the robot's description counts as its head's."""
    return [joint.name for joint in robot.joints if joint.segment == "head"]


def _count_feet(link: Link, is_foot: Callable[[Link], bool]) -> int:
    return max(sum(_count_feet(child, is_foot) for child in link.children), int(is_foot(link)))


def _carries_limbs(link: Link, aside: Callable[[Link], float]) -> bool:
    """Tell whether a link in the middle branches, or leads to limbs on the left and right."""
    if len(link.children) > 1 and abs(aside(link)) < BESIDE:
        return True
    while len(link.children) == 1:
        link = link.children[0]
    places = [aside(child) for child in link.children]
    return min(places, default=0.0) < -BESIDE and max(places, default=0.0) > BESIDE


def _find_way(link: Link, body: int) -> list[Link]:
    """Find the links from one down to the one that holds a body; none if it is not below."""
    if body in link.bodies:
        return [link]
    for child in link.children:
        if way := _find_way(child, body):
            return [link, *way]
    return []


def leg_length(robot: Robot) -> float:
    """Measure the distance of a leg's first joint from its sole, all joints at 0 [m].

    Two other lengths serve other ends: `Leg.measure_stretched` goes through the joints that bend a
    leg, and says how deep it crouches; `Limbs.thigh_and_shank` leaves the foot out.
    """
    model = robot.spec().compile()
    sole = model.site(robot.sole_sites[0]).id
    legs = [leg for _, leg in find_robot_parts(robot, model).legs]
    leg = next((leg for leg in legs if any(sole in link.sites for link in leg.walk())), None)
    if leg is None:
        raise RobotError(
            f"robot '{robot.name}' has no leg that ends in site '{robot.sole_sites[0]}', expected "
            "sole_sites on feet that hang on joints"
        )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(np.linalg.norm(data.xanchor[leg.joints[0]] - data.site_xpos[sole]))
