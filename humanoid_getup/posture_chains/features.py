"""Features of resting robots: what tells how near they are to a goal, and which are alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.body.limbs import LEGS, Limbs
from robots.body.parts import leg_length
from robots.kinematics import place
from robots.quaternion import Array

GRAVITY_STEP = 0.4  # of a cell, along each axis of the unit vector
NECK_STEP = 0.09  # of standing height
UPHILL = np.array([1.0, 0.0, 0.0])
UPHILL_STEP, UPHILL_WEIGHT = 0.8, 0.5  # of a cell, and beside the vertical, on a slope
FLAT_STEPS = 3
OFFSET_STEP, MOST_OFFSET = 0.3, 4  # leg lengths, and cells
ON_GROUND = 0.004  # m that a sole on the ground may be above it
SOLE_REACH = 0.1  # leg lengths over which a sole that is lifted counts less
BALANCED = 0.35  # leg lengths from between the soles, over which balance counts less
SPLIT = 0.6  # leg lengths that the soles are too far apart, over which it does, too
PLACE_STEP, TURN_STEP = 0.25, 0.8  # leg lengths, and along each axis of the vertical


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
    """What matters of resting robots, (K, ...)."""

    progress: Array
    """How near robots are to the goal, at most 1, (K,)."""
    cells: NDArray[np.int_]
    """The cells in which robots that are alike are filed, (K, c)."""
    places: Array
    """Vectors that are near to each other for robots that are alike, (K, d)."""

    def join(self, others: Self, rows: int) -> Self:
        """Join the features of the same number of rows of robots each."""

        def both(name: str) -> Array:
            parts = (getattr(self, name), getattr(others, name))
            wide = [part.reshape(rows, -1, *part.shape[1:]) for part in parts]
            joined = np.concatenate(wide, axis=1)
            return joined.reshape(-1, *joined.shape[2:])

        return replace(self, **{field.name: both(field.name) for field in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class StandFeatures(Features):
    """What matters of robots that are to stand."""

    up: Array
    """The world's vertical in the torso's frame, (K, 3)."""
    neck: Array
    """Height of the neck over the ground as a share of that of the stance, (K,)."""
    flatness: Array
    """How flat the less flat sole is on the ground, from 0 to 1, (K,)."""
    offset: Array
    """Horizontal distance of the center of mass from between the soles [leg lengths], (K,)."""
    split: Array
    """How much farther apart the soles are than in the stance [leg lengths], (K,)."""


class StandMeter:
    """Measures how near robots are to a stand, in one world."""

    def __init__(self, world: World) -> None:
        self._world, model = world, world.model
        self._data = mujoco.MjData(model)
        self._layout = world.robot.layout(model)
        self._soles = [model.site(name).id for name in world.robot.sole_sites]
        self._neck = model.site(world.robot.neck_site).id
        self._leg = leg_length(world.robot)
        self._data.qpos[:] = place(world.robot, model, world.robot.standing)
        mujoco.mj_kinematics(model, self._data)
        self._apart = _measure_apart(self._data.site_xpos[self._soles])

    def measure(self, qpos: Array) -> StandFeatures:
        """Measure robots at MuJoCo positions (K, nq)."""
        model, data, count = self._world.model, self._data, len(qpos)
        soles, normal = np.zeros((2, count, len(self._soles), 3))
        center, neck = np.zeros((count, 3)), np.zeros((count, 3))
        for k, row in enumerate(qpos):
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            soles[k], normal[k] = data.site_xpos[self._soles], data.site_xmat[self._soles][:, 2::3]
            center[k], neck[k] = data.subtree_com[self._layout.torso], data.site_xpos[self._neck]
        scene = self._world.scene
        support, ground = scene.support, scene.ground.normal(soles[..., 0], soles[..., 1], 0.01)
        turned = np.sum(normal * ground, axis=-1)
        lifted = np.maximum(soles[..., 2] - support(soles) - ON_GROUND, 0.0)
        flat = np.clip(turned, 0.0, 1.0) * np.exp(-lifted / (SOLE_REACH * self._leg))
        between = soles[..., :2].mean(axis=1)
        flatness, up = flat.min(axis=1), _find_up(qpos[:, self._layout.root_orientation])
        height = (neck[:, 2] - support(neck)) / self._world.robot.standing_neck_height
        offset = np.linalg.norm(center[:, :2] - between, axis=1) / self._leg
        split = np.maximum(_measure_apart(soles) - self._apart, 0.0) / self._leg
        balance = np.exp(-((offset / BALANCED) ** 2) - (split / SPLIT) ** 2)
        on_soles = flatness * (0.3 + 0.7 * balance)
        upright = np.maximum(up[:, 2], 0.0) * flatness * balance
        cells = [
            np.round(up / GRAVITY_STEP),
            np.floor(height / NECK_STEP),
            np.minimum(np.floor(flatness * FLAT_STEPS), FLAT_STEPS - 1),
            np.minimum(np.floor(offset / OFFSET_STEP), MOST_OFFSET),
        ]
        places = [up, height[:, None], 0.5 * flatness[:, None], 0.3 * offset[:, None]]
        if scene.slope:  # where it matters which way a robot faces
            uphill = _find_in_torso(qpos[:, self._layout.root_orientation], UPHILL)
            cells.append(np.round(uphill / UPHILL_STEP))
            places.append(UPHILL_WEIGHT * uphill)
        return StandFeatures(
            progress=0.35 * np.clip(height, 0.0, 1.0) + 0.35 * on_soles + 0.3 * upright,
            cells=np.column_stack(cells).astype(int),
            places=np.hstack(places),
            up=up,
            neck=height,
            flatness=flatness,
            offset=offset,
            split=split,
        )


class PlaceMeter:
    """Measures how near robots are to a place."""

    def __init__(self, world: World, distance: Callable[[Array], Array]) -> None:
        """Prepare for a world; ``distance`` maps positions of the torso (..., 3) to (...) [m]."""
        self._layout, self._distance = world.robot.layout(world.model), distance
        self._leg = leg_length(world.robot)

    def measure(self, qpos: Array) -> Features:
        """Measure robots at MuJoCo positions (K, nq); those alike have place and attitude alike."""
        root = qpos[:, self._layout.root_position]
        position, up = root[:, :2] / self._leg, _find_up(qpos[:, self._layout.root_orientation])
        return Features(
            progress=1.0 - self._distance(root) / self._leg,
            cells=np.round(np.hstack([position / PLACE_STEP, up / TURN_STEP])).astype(int),
            places=np.hstack([position, up]),
        )


LEGS_STEP, MOST_LEGS = 0.25, 6  # rad RMS of a cell, and cells
ARRIVED = 0.75  # progress of robots that are at a posture


class PostureMeter:
    """Measures how near robots are to a posture: by the attitude of the torso and by the legs."""

    def __init__(self, world: World, qpos: Array) -> None:
        """Prepare for MuJoCo positions (nq,)."""
        self._world, self._stand = world, StandMeter(world)
        self._layout, limbs = world.robot.layout(world.model), Limbs(world.robot)
        self._legs = np.array([k for name in LEGS for k in limbs.all[name].joints])
        self._up, self._angles = self._read(qpos[None])

    def _read(self, qpos: Array) -> tuple[Array, Array]:
        angles = qpos[..., self._layout.qpos][..., self._legs]
        return _find_up(qpos[..., self._layout.root_orientation]), angles

    def _measure_far(self, angles: Array) -> Array:
        return np.sqrt(np.mean((angles - self._angles[0]) ** 2, axis=-1))

    def measure_progress(self, qpos: Array) -> Array:
        """Measure how near robots at MuJoCo positions (..., nq) are, at most 1, (...)."""
        up, angles = self._read(qpos)
        turned = np.arccos(np.clip(up @ self._up[0], -1.0, 1.0))
        return np.exp(-turned - self._measure_far(angles))

    def measure(self, qpos: Array) -> Features:
        """Measure robots at MuJoCo positions (K, nq)."""
        up, angles = self._read(qpos)
        far = self._measure_far(angles)
        neck = self._stand.measure(qpos).neck
        cells = [
            np.round(up / GRAVITY_STEP),
            np.floor(neck / NECK_STEP),
            np.minimum(np.floor(far / LEGS_STEP), MOST_LEGS),
        ]
        return Features(
            progress=self.measure_progress(qpos),
            cells=np.column_stack(cells).astype(int),
            places=np.hstack([up, neck[:, None], 0.5 * far[:, None]]),
        )


Meter = StandMeter | PlaceMeter | PostureMeter


def _measure_apart(soles: Array) -> Array:
    """Measure how far apart soles (..., S, 3) are, horizontally, (...) [m]."""
    between = soles[..., :2].mean(axis=-2, keepdims=True)
    return 2.0 * np.linalg.norm(soles[..., :2] - between, axis=-1).max(axis=-1)


def _find_up(orientation: Array) -> Array:
    """Return the world's vertical in the frames of torsos, (K, 3)."""
    return _find_in_torso(orientation, np.array([0.0, 0.0, 1.0]))


def _find_in_torso(orientation: Array, direction: Array) -> Array:
    """Return a direction of the world (3,) in the frames of torsos, (K, 3)."""
    return quaternion.rotate(quaternion.inverse(orientation), direction)
