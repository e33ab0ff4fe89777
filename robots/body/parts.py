"""Parts of a body: its links, which of them are trunk, and where legs, arms and heads begin."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np

from robots.quaternion import Array
from robots.robot import Robot, RobotError


@dataclass(eq=False)
class Link:
    """A body with joints, and the bodies that are welded to it."""

    model: mujoco.MjModel
    bodies: list[int]
    """The body with the joints first, parents before children."""
    children: list[Link] = field(default_factory=list)
    """Links that hang on it by a joint."""

    @property
    def root(self) -> int:
        """Return the body with the joints."""
        return self.bodies[0]

    @property
    def joints(self) -> list[int]:
        """Return its joints."""
        first = int(self.model.body_jntadr[self.root])
        return list(range(first, first + int(self.model.body_jntnum[self.root])))

    @cached_property
    def sites(self) -> list[int]:
        """Return the sites on it."""
        return np.flatnonzero(np.isin(self.model.site_bodyid, self.bodies)).tolist()

    @property
    def geoms(self) -> list[int]:
        """Return the shapes on it, body by body."""
        model = self.model
        return [
            int(model.body_geomadr[body]) + k
            for body in self.bodies
            for k in range(int(model.body_geomnum[body]))
        ]

    def walk(self) -> Iterator[Link]:
        """Return this link and all below it, parents before children."""
        yield self
        for link in self.children:
            yield from link.walk()

    def list_bodies(self) -> list[int]:
        """List all bodies of this link and those below it, by their ids."""
        return sorted(body for link in self.walk() for body in link.bodies)

    def anchor(self) -> Array:
        """Return the position of its first joint, in its frame [m], (3,)."""
        joint = self.model.body_jntadr[self.root]
        if joint < 0 or self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            return np.zeros(3)
        return self.model.jnt_pos[joint].copy()


def gather_links(model: mujoco.MjModel, body: int) -> Link:
    """Gather a body, what is welded to it, and the links that hang on both."""
    link = Link(model, [body])
    for part in link.bodies:  # which grows
        for child in np.flatnonzero(model.body_parentid == part).tolist():
            if child == part:  # the world is its own parent
                continue
            if model.body_jntnum[child]:
                link.children.append(gather_links(model, child))
            else:
                link.bodies.append(child)
    return link


def list_way_up(model: mujoco.MjModel, body: int) -> list[int]:
    """List the bodies from one up to the world, without the world."""
    way = []
    while body > 0:
        way.append(body)
        body = int(model.body_parentid[body])
    return way


@dataclass(eq=False)
class LinkFrames:
    """Frames of links, those of their first bodies, where `data` has them."""

    data: mujoco.MjData

    def pose(self, body: int, link: Link) -> tuple[Array, Array]:
        """Return position [m], (3,), and axes, (3, 3), of a body in a link's frame."""
        axes = self.axes(link)
        away = self.data.xpos[body] - self.data.xpos[link.root]
        return axes.T @ away, axes.T @ self.data.xmat[body].reshape(3, 3)

    def axes(self, link: Link) -> Array:
        """Return the axes of a link's frame in the world, in columns, (3, 3)."""
        return self.data.xmat[link.root].reshape(3, 3)

    def turn(self, direction: Array, source: Link, target: Link) -> Array:
        """Convert a direction (3,) from one link's frame to another's."""
        return self.axes(target).T @ (self.axes(source) @ direction)

    def anchor_in(self, link: Link, frame: Link) -> Array:
        """Return the position of a link's first joint in the frame of another [m], (3,)."""
        position, axes = self.pose(link.root, frame)
        return position + axes @ link.anchor()


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
