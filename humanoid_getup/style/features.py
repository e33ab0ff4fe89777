"""Style features: neck height and the torso's side and front angles, measured or estimated.

The features are those of [Frezzato22], section 4.2. The height is a share of the robot's own
standing neck height, so that curves carry over between bodies.
"""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch

from humanoid_getup.scenes.ground import Ground
from robots import Robot, quaternion
from robots.kinematics import GeomReach
from robots.quaternion import Array

COUNT = 3
"""Number of features: neck height, side angle, front angle, in this order."""
# Heights are over the mean of the ground around a robot, so far to each side in shares of its neck
# height: 0.5 m for the human of [Frezzato22].
AROUND = 0.5 / 1.46
UPSIDE_DOWN = 1e-6  # the least of (1 + cos tilt) / 2, where any turn leads to upside down


def torso_angles(gravity: Array) -> Array:
    """Compute the side and front angles [rad], (..., 2), from gravity in the torso, (..., 3).

    They are the angles of the torso's right side and of its front with the upward vertical: both
    are a quarter turn while standing. The front angle is 0 when supine and pi when prone; the
    side angle is 0 on the left side and pi on the right.
    """
    right, front = gravity[..., 1], -gravity[..., 0]
    return np.arccos(np.clip(np.stack([right, front], axis=-1), -1.0, 1.0))


def mirror_features(features: Array) -> Array:
    """Exchange left and right in features, (..., 3)."""
    height, side, front = np.moveaxis(features, -1, 0)
    return np.stack([height, np.pi - side, front], axis=-1)


def angle_distance(features: Array, others: Array) -> Array:
    """Compute the larger of the differences of the two angles [rad], (...)."""
    return np.abs(features[..., 1:] - others[..., 1:]).max(axis=-1)


class FeatureSense:
    """Estimates the features of N robots from their sensors, by forward kinematics.

    No sensor of a robot measures its height, so its lowest point is assumed to touch level ground.
    """

    def __init__(self, robot: Robot, n: int = 1, threads: int = 1) -> None:
        """Prepare to estimate the features of ``n`` robots; 0 threads are one per processor."""
        spec = robot.spec()
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0  # no contacts are looked for
        model = spec.compile()
        layout = robot.layout(model)
        self._batch = Batch(model, n, threads)
        names = ("qpos", "geom_xpos", "geom_xmat", "site_xpos")
        self._qpos, self._geom_pos, self._geom_mat, self._site_pos = map(self._batch.bind, names)
        self._joints, self._orientation = layout.qpos, layout.root_orientation
        self._reach = GeomReach(model)
        self._neck = model.site(robot.neck_site).id
        self._size = robot.standing_neck_height

    def __call__(self, gravity: Array, joint_pos: Array) -> Array:
        """Estimate features, (N, 3), from gravity in the torso (N, 3) and angles (N, n) [rad]."""
        self._qpos[:, self._joints] = joint_pos
        self._qpos[:, self._orientation] = level(gravity)
        self._batch.forward(stage=mujoco.mjtStage.mjSTAGE_POS.value)
        own = self._reach.geoms
        up = self._geom_mat.reshape(len(joint_pos), -1, 9)[:, own, 6:]
        height = self._geom_pos[:, own, 2] - self._reach(up)
        neck = self._site_pos[:, self._neck, 2] - height.min(axis=-1)
        return np.concatenate([neck[:, None] / self._size, torso_angles(gravity)], axis=-1)


def level(gravity: Array) -> Array:
    """Compute an orientation (..., 4) that has this direction of gravity in the torso, (..., 3).

    It is the shortest turn from upright, so that its heading is that of the robot.
    """
    x, y, z = np.moveaxis(-gravity, -1, 0)  # the upward vertical in the torso
    w = np.sqrt(np.maximum(0.5 * (1.0 + z), UPSIDE_DOWN))
    return quaternion.normalize(np.stack([w, 0.5 * y / w, -0.5 * x / w, np.zeros_like(w)], axis=-1))


def find_ahead(orientation: Array) -> Array:
    """Find where orientations (..., 4) head, by the shortest turn to upright: (..., 3)."""
    upright = level(quaternion.gravity_in_body(orientation))
    heading = quaternion.multiply(orientation, quaternion.inverse(upright))
    return quaternion.rotate(heading, np.array([1.0, 0.0, 0.0]))


GRID = 5
"""Points on each side of the height map, whose rows run forward and columns to the left."""
PLACES = np.linspace(-1.0, 1.0, GRID)
FORWARD, LEFT = (grid.ravel() for grid in np.meshgrid(PLACES, PLACES, indexing="ij"))
UNKNOWN = np.zeros(GRID**2)
"""Height map of a robot without knowledge of the ground: level."""


def measure_height_map(robot: Robot, ground: Ground, position: Array, orientation: Array) -> Array:
    """Measure the heights of the ground around robots, (N, 25), as shares of standing.

    They are those of 5 by 5 points, over their mean: rows forward, columns to the left of where
    the torso is turned. Positions of the torso are (N, 3) [m], orientations (N, 4).
    """
    if ground.is_level:
        return np.tile(UNKNOWN, (len(position), 1))
    ahead = find_ahead(orientation)[:, :2]
    size = robot.standing_neck_height
    cos, sin = AROUND * size * ahead.T[..., np.newaxis]
    x = position[:, :1] + cos * FORWARD - sin * LEFT
    y = position[:, 1:2] + sin * FORWARD + cos * LEFT
    heights = ground.height(x, y) / size
    return heights - heights.mean(axis=1, keepdims=True)
