"""Links of a model: its bodies with joints, and what is welded to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np

from robots.quaternion import Array


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
