"""The skeleton of a model: links, and which of them are trunk, arms and legs."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np

from robots.quaternion import Array


@dataclass(eq=False)
class Link:
    """A body with joints, and the bodies that are welded to it."""

    bodies: list[mujoco.MjsBody]
    """The body with the joints first, parents before children."""
    children: list[Link] = field(default_factory=list)
    """Links that hang on it by a joint."""

    @property
    def root(self) -> mujoco.MjsBody:
        """Return the body with the joints."""
        return self.bodies[0]

    def walk(self) -> Iterator[Link]:
        """Return this link and all below it, parents before children."""
        yield self
        for link in self.children:
            yield from link.walk()

    @cached_property
    def site_names(self) -> frozenset[str]:
        """Return the names of the sites on it."""
        return frozenset(site.name for body in self.bodies for site in body.sites)


class Skeleton:
    """Links of a compiled model whose joints are all at their zeros.

    Legs end in soles; heads have joints of the segment "head" alone; what else hangs on the trunk
    are arms. A link that hangs on the trunk by a joint and carries several limbs is trunk, too,
    like a chest or a pelvis on a waist
    joint.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        *,
        torso: str,
        sole_sites: Collection[str],
        head_joints: Collection[str],
    ) -> None:
        self.spec, self.model = spec, spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        self._soles, self._head = frozenset(sole_sites), frozenset(head_joints)
        self.torso = _gather(spec.body(torso))
        self.trunk: list[Link] = []
        self.arms: list[tuple[Link, Link]] = []
        """Links of the trunk, and the first links of the arms that hang on them."""
        self.legs: list[tuple[Link, Link]] = []
        self._sort(self.torso)

    def _sort(self, trunk: Link) -> None:
        self.trunk.append(trunk)
        for link in trunk.children:
            if sum(self._ends_in_sole(child) for child in link.children) > 1:
                self._sort(link)
            elif self._ends_in_sole(link):
                self.legs.append((trunk, link))
            elif not self._is_head(link):
                if len(link.children) > 1:
                    self._sort(link)
                else:
                    self.arms.append((trunk, link))

    def _ends_in_sole(self, link: Link) -> bool:
        return any(self.has_sole(part) for part in link.walk())

    def _is_head(self, link: Link) -> bool:
        joints = {
            joint.name for part in link.walk() for body in part.bodies for joint in body.joints
        }
        return joints <= self._head

    def has_sole(self, link: Link) -> bool:
        """Return whether a link is a foot."""
        return bool(link.site_names & self._soles)

    def sole(self, link: Link) -> Array:
        """Return the middle of a foot's soles, in its frame [m], (3,)."""
        names = link.site_names & self._soles
        away = [self.data.site(n).xpos - self.data.xpos[link.root.id] for n in sorted(names)]
        return self.axes(link).T @ np.mean(away, axis=0)

    def pose(self, body: mujoco.MjsBody, link: Link) -> tuple[Array, Array]:
        """Return position [m], (3,), and axes, (3, 3), of a body in a link's frame."""
        axes = self.axes(link)
        away = self.data.xpos[body.id] - self.data.xpos[link.root.id]
        return axes.T @ away, axes.T @ self.data.xmat[body.id].reshape(3, 3)

    def axes(self, link: Link) -> Array:
        """Return the axes of a link's frame in the world, in columns, (3, 3)."""
        return self.data.xmat[link.root.id].reshape(3, 3)

    def turn(self, direction: Array, source: Link, target: Link) -> Array:
        """Convert a direction (3,) from one link's frame to another's."""
        return self.axes(target).T @ (self.axes(source) @ direction)

    def anchor(self, link: Link) -> Array:
        """Return where a link's first joint is, in its frame [m], (3,)."""
        joint = self.model.body_jntadr[link.root.id]
        is_free = self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        return np.zeros(3) if is_free else self.model.jnt_pos[joint].copy()

    def anchor_in(self, link: Link, parent: Link) -> Array:
        """Return where a link's first joint is in the frame of another [m], (3,)."""
        position, axes = self.pose(link.root, parent)
        return position + axes @ self.anchor(link)

    def bounds(self, link: Link, frame: Link) -> Array | None:
        """Return the box that holds a link's shapes, in the frame of another, (2, 3) [m]."""
        boxes = [self.bounds_of(geom, frame) for body in link.bodies for geom in body.geoms]
        if not boxes:
            return None
        corners = np.array(boxes)
        return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])

    def bounds_of(self, geom: mujoco.MjsGeom, frame: Link) -> Array:
        """Return the box that holds a geom, in the frame of a link, (2, 3) [m]."""
        axes = self.axes(frame)
        own = axes.T @ self.data.geom_xmat[geom.id].reshape(3, 3)
        middle, half = self.model.geom_aabb[geom.id].reshape(2, 3)
        away = self.data.geom_xpos[geom.id] - self.data.xpos[frame.root.id]
        center = axes.T @ away + own @ middle
        reach = np.abs(own) @ half
        return np.array([center - reach, center + reach])


def _gather(root: mujoco.MjsBody) -> Link:
    """Gather a body, what is welded to it, and the links that hang on both."""
    link = Link([root])
    for body in link.bodies:  # which grows
        for child in body.bodies:
            if child.joints:
                link.children.append(_gather(child))
            else:
                link.bodies.append(child)
    return link
