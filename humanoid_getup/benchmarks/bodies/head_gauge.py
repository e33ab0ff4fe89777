"""The measure of others: the height of a robot's head above the middle of its feet."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robots import quaternion
from robots.quaternion import Array

TOLERANCE = 0.2
"""Share of the standing height by which a standing robot's head may be off."""
TIME_LIMIT = 5.0  # s, of an episode
APART = 0.002  # m by which a point may be elsewhere in the rebuilt model


@dataclass(frozen=True, eq=False)
class BodyPoint:
    """A point that moves with a body."""

    body: int
    position: Array
    """In the body's frame [m], (3,)."""

    def locate(self, data: mujoco.MjData) -> Array:
        """Return its place in the world [m], (3,)."""
        axes = data.xmat[self.body].reshape(3, 3)
        return data.xpos[self.body] + axes @ self.position


class HeadGauge:
    """Measures the height of a robot's head by the sites of the model that it was made from."""

    def __init__(
        self,
        source: mujoco.MjModel,
        model: mujoco.MjModel,
        *,
        head: str,
        feet: tuple[str, str],
        standing: float,
    ) -> None:
        """Find the sites of a model in the robot's own one.

        Args:
            source: The model with the sites.
            model: The robot's, whose bodies have the same names and frames.
            head: Site whose height is measured.
            feet: Sites from whose middle.
            standing: Height of a standing robot's head [m].

        Raises:
            ValueError: if a site is missing, or elsewhere in the robot's model.
        """
        self._data, self.standing = mujoco.MjData(model), standing
        self._model = model
        self._head, *self._feet = (_find_point(source, model, name) for name in (head, *feet))
        self._check(source, (head, *feet))

    def measure(self, qpos: Array) -> float:
        """Return the height of the head as a share of the standing one, at positions (nq,)."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        feet = np.mean([point.locate(self._data)[2] for point in self._feet])
        return float(self._head.locate(self._data)[2] - feet) / self.standing

    def _check(self, source: mujoco.MjModel, names: tuple[str, ...]) -> None:
        """Compare the points in the torso's frame with all joints as in the files."""
        before = mujoco.MjData(source)
        mujoco.mj_kinematics(source, before)
        mujoco.mj_kinematics(self._model, self._data)
        root = int(
            source.jnt_bodyid[np.flatnonzero(source.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]]
        )
        for name, point in zip(names, (self._head, *self._feet), strict=True):
            was = _see_from(before, root, before.site(name).xpos)
            now = _see_from(self._data, 1, point.locate(self._data))
            if (apart := float(np.linalg.norm(was - now))) > APART:
                raise ValueError(
                    f"site '{name}' is {1e3 * apart:.0f} mm from its place in the source model, "
                    f"expected at most {1e3 * APART:.0f} mm: import the robot again"
                )


def is_standing(share: float) -> bool:
    """Tell whether a head is as high as that of a standing robot, by its share of that height."""
    return abs(1.0 - share) < TOLERANCE


def _find_point(source: mujoco.MjModel, model: mujoco.MjModel, name: str) -> BodyPoint:
    """Find where a site of a model is in another one that lacks bodies without joints."""
    site = mujoco.mj_name2id(source, mujoco.mjtObj.mjOBJ_SITE, name)
    if site < 0:
        raise ValueError(f"the source model has no site '{name}', expected one")
    body, position = int(source.site_bodyid[site]), source.site_pos[site].copy()
    while (own := _find_body(model, source.body(body).name)) < 0:
        if not body:
            raise ValueError(f"site '{name}' is on no body of the robot, expected one")
        turned = quaternion.rotate(source.body_quat[body], position)
        position = source.body_pos[body] + turned
        body = int(source.body_parentid[body])
    return BodyPoint(own, position)


def _find_body(model: mujoco.MjModel, name: str) -> int:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)


def _see_from(data: mujoco.MjData, body: int, point: Array) -> Array:
    return data.xmat[body].reshape(3, 3).T @ (point - data.xpos[body])
