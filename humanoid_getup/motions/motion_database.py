"""The rising motions of a robot, and the posture in them that is nearest to a given one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.posture_metric import PostureMetric, aligned_orientation_distance
from robots import Posture, Robot
from robots.quaternion import Array

MOTION_FOLDER = "motions"
GROUPS = 50  # [Lin12], section 5
ROUNDING = 1e-9  # of a bound that is equal to a distance
SAME_POSTURE = 0.02  # rad; a motion closer than this to its mirror image is symmetric


@dataclass(frozen=True)
class Connection:
    """A frame of a motion at which the rise can join it."""

    motion: Motion
    frame: int
    distance: float
    """Posture metric from the posture asked for."""

    @property
    def posture(self) -> Posture:
        """Return the connecting posture."""
        return self.motion.posture(self.frame)


@dataclass(frozen=True)
class Group:
    """A leaf of the tree: postures alike."""

    center: Array
    """Mean of the embedded postures, shape (d,)."""
    radius: float
    """Largest distance of a member from it."""
    members: NDArray[np.intp]
    """Rows of the entry postures."""


class MotionDatabase:
    """Rising motions whose entry postures are grouped for search.

    The tree has two levels as in [Lin12], section 4.1: its root holds the mean of every
    group, its leaves the groups. Groups are searched from the nearest on, until the
    next can hold nothing better; the answer is that of a search through all postures.
    """

    def __init__(
        self, motions: list[Motion], metric: PostureMetric, groups: int = GROUPS, seed: int = 0
    ) -> None:
        if not motions:
            raise ValueError("a motion database needs at least one motion")
        self.motions = tuple(motions)
        self.metric = metric
        self._motion = np.concatenate(
            [np.full(len(m.entry_frames), i) for i, m in enumerate(motions)]
        )
        self._frame = np.concatenate([m.entry_frames for m in motions])
        self._orientation = np.concatenate([m.orientation[m.entry_frames] for m in motions])
        self._joint_pos = np.concatenate([m.joint_pos[m.entry_frames] for m in motions])
        points = metric.embed(self._orientation, self._joint_pos)
        self.groups = _group(points, groups, seed)
        self._centers = np.array([group.center for group in self.groups])
        self._radii = np.array([group.radius for group in self.groups])

    def __len__(self) -> int:
        return len(self._frame)

    def select(self, posture: Posture, count: int = 1, per_motion: int = 1) -> list[Connection]:
        """Find the best entry postures for a posture, nearest first.

        Args:
            posture: Where the robot is.
            count: How many to find.
            per_motion: How many of them may come from one motion.
        """
        point = self.metric.embed(posture.orientation, posture.joint_pos)
        bound = np.linalg.norm(self._centers - point, axis=1) - self._radii  # (groups,)
        order = np.argsort(bound)
        # The nearest groups give a distance to beat; every group that may beat it is searched.
        near = np.concatenate([self.groups[g].members for g in order[: count + 1]])
        best = self._take(near, self._distance(posture, near), count, per_motion)
        if len(best) < count:
            return self.select_exhaustively(posture, count, per_motion)
        rivals = order[bound[order] <= best[-1].distance + ROUNDING]
        rows = np.concatenate([near, *(self.groups[g].members for g in rivals[count + 1 :])])
        return self._take(rows, self._distance(posture, rows), count, per_motion)

    def select_exhaustively(
        self, posture: Posture, count: int = 1, per_motion: int = 1
    ) -> list[Connection]:
        """Find the same by comparing with every entry posture."""
        rows = np.arange(len(self))
        return self._take(rows, self._distance(posture, rows), count, per_motion)

    def _distance(self, posture: Posture, rows: NDArray[np.intp]) -> Array:
        return self.metric.distance(
            posture.orientation, posture.joint_pos, self._orientation[rows], self._joint_pos[rows]
        )

    def _take(
        self, rows: NDArray[np.intp], distance: Array, count: int, per_motion: int
    ) -> list[Connection]:
        taken = np.zeros(len(self.motions), dtype=int)
        best: list[Connection] = []
        for i in np.lexsort((rows, distance)):
            motion = self._motion[rows[i]]
            if taken[motion] < per_motion:
                taken[motion] += 1
                frame = int(self._frame[rows[i]])
                best.append(Connection(self.motions[motion], frame, float(distance[i])))
            if len(best) == count:
                break
        return best


def load_database(robot: Robot, groups: int = GROUPS, seed: int = 0) -> MotionDatabase:
    """Load a robot's motions, and the mirror image of each that is not symmetric.

    Raises:
        ValueError: if the robot has none, or a file is damaged or another robot's.
    """
    folder = robot.folder / MOTION_FOLDER
    motions: list[Motion] = []
    for path in sorted(folder.glob("*.npz")):
        motion = Motion.load(path)
        if motion.robot != robot.name or motion.joint_pos.shape[1] != robot.n:
            raise ValueError(
                f"motion file {path}: made for '{motion.robot}' with "
                f"{motion.joint_pos.shape[1]} joints, allowed '{robot.name}' with {robot.n}"
            )
        motions.append(motion)
        mirrored = motion.mirrored(robot)
        if not is_same(motion, mirrored):
            motions.append(mirrored)
    if not motions:
        raise ValueError(f"robot '{robot.name}' has no motions: allowed .npz files in {folder}")
    return MotionDatabase(motions, PostureMetric.of(robot), groups, seed)


def find_motion(robot: Robot, name: str) -> Motion:
    """Find a motion by name in a robot's database, or load an .npz file.

    Raises:
        ValueError: if there is no such motion, or it is another robot's.
    """
    if not name.endswith(".npz"):
        motions = {motion.name: motion for motion in load_database(robot).motions}
        if name not in motions:
            known = ", ".join(motions)
            raise ValueError(f"unknown motion '{name}', expected {known} or an .npz file")
        return motions[name]
    motion = Motion.load(Path(name))
    joints = motion.joint_pos.shape[1]
    if motion.robot != robot.name or joints != robot.n:
        raise ValueError(
            f"motion file {name}: made for '{motion.robot}' with {joints} joints, "
            f"expected '{robot.name}' with {robot.n}"
        )
    return motion


def is_same(a: Motion, b: Motion) -> bool:
    """Return whether two motions of equal times go through the same postures."""
    differences = [
        aligned_orientation_distance(a.orientation, b.orientation),
        np.abs(a.joint_pos - b.joint_pos),
        np.abs(a.joint_target - b.joint_target),
    ]
    return all(np.max(difference) < SAME_POSTURE for difference in differences)


def _group(points: Array, groups: int, seed: int) -> list[Group]:
    """Cluster points (N, d) by k-means; as many groups as asked for, or fewer."""
    groups = min(groups, len(np.unique(points, axis=0)))
    rng = np.random.default_rng(seed)
    _, label = kmeans2(points, groups, minit="++", rng=rng, missing="warn")
    leaves: list[Group] = []
    for g in np.unique(label):
        members = np.flatnonzero(label == g)
        center = points[members].mean(axis=0)
        radius = float(np.linalg.norm(points[members] - center, axis=1).max())
        leaves.append(Group(center, radius, members))
    return leaves
