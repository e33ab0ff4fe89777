"""The skeleton of a model to reshape: its parts, with joints at zero."""

from __future__ import annotations

from collections.abc import Collection

import mujoco
import numpy as np

from robots.body.links import Link, LinkFrames
from robots.body.parts import find_parts
from robots.quaternion import Array


class Skeleton(LinkFrames):
    """Parts of a compiled specification, with all joints at zero."""

    def __init__(
        self,
        spec: mujoco.MjSpec,
        *,
        torso: str,
        sole_sites: Collection[str],
        head_joints: Collection[str],
    ) -> None:
        self.spec, self.model = spec, spec.compile()
        super().__init__(mujoco.MjData(self.model))
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        self._soles = {self.model.site(name).id for name in sole_sites}
        self._bodies = {body.id: body for body in spec.bodies}
        self.parts = find_parts(self.model, torso, sole_sites, head_joints)

    @property
    def torso(self) -> Link:
        """Return the torso."""
        return self.parts.torso

    def root(self, link: Link) -> mujoco.MjsBody:
        """Return the body of a link that has the joints."""
        return self._bodies[link.root]

    def bodies(self, link: Link) -> list[mujoco.MjsBody]:
        """Return the bodies of a link, the one with the joints first."""
        return [self._bodies[body] for body in link.bodies]

    def has_sole(self, link: Link) -> bool:
        """Return whether a link is a foot."""
        return not self._soles.isdisjoint(link.sites)

    def sole(self, link: Link) -> Array:
        """Return the middle of a foot's soles, in its frame [m], (3,)."""
        soles = sorted(
            self._soles.intersection(link.sites), key=lambda site: self.model.site(site).name
        )
        away = [self.data.site_xpos[sole] - self.data.xpos[link.root] for sole in soles]
        return self.axes(link).T @ np.mean(away, axis=0)

    def bounds(self, link: Link, frame: Link) -> Array | None:
        """Return the box that holds a link's shapes, in the frame of another, (2, 3) [m]."""
        boxes = [self.bounds_of(geom, frame) for geom in link.geoms]
        if not boxes:
            return None
        corners = np.array(boxes)
        return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])

    def bounds_of(self, geom: int, frame: Link) -> Array:
        """Return the box that holds a geom, in the frame of a link, (2, 3) [m]."""
        axes = self.axes(frame)
        own = axes.T @ self.data.geom_xmat[geom].reshape(3, 3)
        middle, half = self.model.geom_aabb[geom].reshape(2, 3)
        away = self.data.geom_xpos[geom] - self.data.xpos[frame.root]
        center = axes.T @ away + own @ middle
        reach = np.abs(own) @ half
        return np.array([center - reach, center + reach])
