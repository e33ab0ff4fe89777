"""The space in which a path is searched: the root's orientation and the joint angles.

A node is a quaternion and the joint angles in a row, (4 + n,).
"""

from __future__ import annotations

import math

import numpy as np

from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.planning.collision import Collision, CollisionChecker
from humanoid_getup.scenes.scene import Scene
from robots import Posture, quaternion
from robots.quaternion import Array

SPAN = math.radians(15.0)  # of a blossom, in each degree of freedom [Lin12], section 4.2.1


def blossom(origin: Array, way: Array, step: float, count: int, rng: np.random.Generator) -> Array:
    """Step along ``way`` (d,), then at up to ±15 degrees to it in each dimension, (count, d)."""
    length = float(np.linalg.norm(way))
    if length == 0.0:
        return np.tile(origin, (count, 1))
    direction = np.tile(way / length, (count, 1))
    direction[1:] += np.tan(rng.uniform(-SPAN, SPAN, size=(count - 1, len(way))))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return origin + min(step, length) * direction


STEP_ORIENTATION = 0.4  # epsilon_q, in dis_Q
STEP_JOINTS = 2.0  # epsilon_e, in dis_V
RESOLUTION = 0.03  # rad; the checks along an edge are no further apart
SPREAD = 0.3  # in dis_Q, of sampled orientations around the arc from start to goal
SMALL = 1e-9  # of an angle, a length or a step; less counts as 0


class PostureProblem:
    """Search space of the root's orientation and the joint angles."""

    def __init__(
        self,
        checker: CollisionChecker,
        metric: PostureMetric,
        start: Posture,
        goal: Posture,
        position_path: Array,
        resolution: float = RESOLUTION,
    ) -> None:
        self.checker, self.resolution = checker, resolution
        self.stride = 1.0
        """Step size as a share of the full one."""
        self.root_weight = metric.root_weight
        self.scale = np.sqrt(metric.joint_weight)  # (n,)
        self.start, self.goal = to_node(start), to_node(goal)
        ends = np.stack([start.joint_pos, goal.joint_pos])
        self.lower = np.minimum(checker.robot.lower, ends.min(axis=0))
        self.upper = np.maximum(checker.robot.upper, ends.max(axis=0))
        self._ends = np.stack([self.start, self.goal])
        self._positions = position_path
        self._leg = np.maximum(np.linalg.norm(np.diff(position_path, axis=0), axis=1), SMALL)
        self._way = np.concatenate([[0.0], np.cumsum(self._leg)])

    def distance(self, nodes: Array, x: Array) -> Array:
        """Compute the metric (1) without alignment: all nodes share one world."""
        return self.root_weight * _turn(nodes[:, :4], x[:4]) + self._bend(nodes[:, 4:], x[4:])

    def sample(self, rng: np.random.Generator) -> Array:
        """Draw joint angles anywhere in their range, and an orientation near the path.

        The orientation is spread about the arc from start to goal: a robot upside down is of
        no use between one lying posture and another.
        """
        arc = quaternion.slerp(self.start[:4], self.goal[:4], rng.uniform())
        q = _left_product(arc) @ _exponential(rng.normal(scale=SPREAD, size=3))
        return np.concatenate([q, rng.uniform(self.lower, self.upper)])

    def steer(
        self, near: Array, target: Array, goal: Array, count: int, rng: np.random.Generator
    ) -> Array:
        """Step by equations (4) and (5), and blossom by ±15 degrees in each degree of freedom.

        Once the orientation or the joint vector has its goal value it is held, and only
        the other is planned: the fix for unsynchronized termination.
        """
        q, v = near[:4], near[4:]
        steps = np.empty((count, len(near)))
        if np.array_equal(q, goal[:4]):
            steps[:, :4] = q
        else:
            steps[:, :4] = self._turn_towards(q, target[:4], count, rng)
        if np.array_equal(v, goal[4:]):
            steps[:, 4:] = v
        else:
            scaled = blossom(
                self.scale * v, self.scale * (target[4:] - v), self.stride * STEP_JOINTS, count, rng
            )
            steps[:, 4:] = np.clip(scaled / self.scale, self.lower, self.upper)
            if self._bend(v, target[4:]) <= self.stride * STEP_JOINTS:
                steps[0, 4:] = target[4:]
        return steps

    def is_within_step(self, a: Array, b: Array) -> bool:
        """Return whether two postures are within a step of each quantity."""
        turn, bend = _turn(a[:4], b[:4]), self._bend(a[4:], b[4:])
        turn, bend = turn / STEP_ORIENTATION, bend / STEP_JOINTS
        return bool(max(turn, bend) <= self.stride + SMALL)

    def fails(self, a: Array, b: Array) -> bool:
        """Return whether the robot collides between ``a`` and ``b``, FAILURE."""
        if not self.is_free(b):  # most edges that fail do so at their end
            return True
        between = self.interpolate(a, b)[:-1]
        return any(not self.checker.is_free(c) for c in self.configurations(between))

    def find_collisions(self, a: Array, b: Array) -> list[Collision]:
        """Find the collisions of the robot between ``a``, left out, and ``b``."""
        between = self.configurations(self.interpolate(a, b))
        return [found for c in between for found in self.checker.find_collisions(c)]

    def is_free(self, node: Array) -> bool:
        """Return whether the posture of a node collides with nothing."""
        return self.checker.is_free(self.configurations(node[None])[0])

    def interpolate(self, a: Array, b: Array, resolution: float | None = None) -> Array:
        """Compute the postures from ``a``, left out, to ``b``, (K, 4 + n), evenly apart."""
        half = math.acos(min(abs(float(a[:4] @ b[:4])), 1.0))
        reach = max(float(np.abs(b[4:] - a[4:]).max()), 2.0 * half)
        count = max(1, math.ceil(reach / (resolution or self.resolution)))
        nodes = self.blend(a, b, np.arange(1, count + 1) / count)
        nodes[-1] = b
        return nodes

    def blend(self, a: Array, b: Array, share: Array) -> Array:
        """Interpolate at shares (K,) of the edge from ``a`` to ``b``, (K, 4 + n)."""
        share = share[:, None]
        cosine = float(a[:4] @ b[:4])
        if cosine < 0.0:  # -q is the same orientation, on the shorter arc
            b = np.concatenate([-b[:4], b[4:]])
        nodes = a + share * (b - a)
        half = math.acos(min(abs(cosine), 1.0))
        if half > SMALL:
            nodes[:, :4] = np.sin((1.0 - share) * half) * a[:4] + np.sin(share * half) * b[:4]
            nodes[:, :4] /= math.sin(half)
        return nodes

    def configurations(self, nodes: Array) -> Array:
        """Put nodes (K, 4 + n) at their planned positions, (K, 7 + n).

        The position follows its path by progress: the distance from the start as a
        share of the distances from start and goal.
        """
        apart = self._ends[:, None, 4:] - nodes[:, 4:]  # (2, K, n)
        apart *= self.scale
        bend = np.sqrt(np.einsum("ekn,ekn->ek", apart, apart))
        turn = np.arccos(np.minimum(np.abs(self._ends[:, :4] @ nodes[:, :4].T), 1.0))
        done, left = bend + self.root_weight * turn  # (K,) each
        way = self._way[-1] * done / (done + left + SMALL)
        leg = np.clip(np.searchsorted(self._way, way), 1, len(self._way) - 1)
        share = (way - self._way[leg - 1]) / self._leg[leg - 1]
        before, after = self._positions[leg - 1], self._positions[leg]
        return np.concatenate([before + share[:, None] * (after - before), nodes], axis=1)

    def _bend(self, v1: Array, v2: Array) -> Array:
        apart = (v1 - v2) * self.scale
        return np.sqrt(np.einsum("...n,...n->...", apart, apart))

    def _turn_towards(self, q: Array, target: Array, count: int, rng: np.random.Generator) -> Array:
        from_body = _left_product(q)
        relative = from_body.T @ target  # q^-1 target
        sine = float(np.linalg.norm(relative[1:]))
        distance = math.atan2(sine, abs(relative[0]))
        if distance <= SMALL:
            return np.tile(target, (count, 1))
        way = relative[1:] * math.copysign(distance / sine, relative[0])
        turns = blossom(np.zeros(3), way, self.stride * STEP_ORIENTATION, count, rng)
        steps = _exponential(turns) @ from_body.T
        if distance <= self.stride * STEP_ORIENTATION:
            steps[0] = target
        return steps


def to_node(posture: Posture) -> Array:
    """Put a posture's orientation and joint angles in a row, (4 + n,)."""
    return np.concatenate([posture.orientation, posture.joint_pos])


def _turn(q1: Array, q2: Array) -> Array:
    """Compute dis_Q by the scalar product, which is fast and exact enough for a search."""
    return np.arccos(np.minimum(np.abs(q1 @ q2), 1.0))


def _left_product(q: Array) -> Array:
    """Make the matrix that multiplies by ``q`` from the left, (4, 4)."""
    w, x, y, z = q
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def _exponential(half_turn: Array) -> Array:
    """Compute the unit quaternions of logarithms (..., 3)."""
    half = np.linalg.norm(half_turn, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), np.sinc(half / np.pi) * half_turn], axis=-1)


STEP = 0.05  # m


class PositionSpace:
    """Positions around a start and a goal."""

    def __init__(self, start: Array, goal: Array, margin: Array | float) -> None:
        """Reach beyond start and goal by a margin [m], in all directions or in each, (3,)."""
        self.low, self.high = np.minimum(start, goal) - margin, np.maximum(start, goal) + margin

    def distance(self, nodes: Array, x: Array) -> Array:
        """Compute Euclidean distances."""
        return np.linalg.norm(nodes - x, axis=1)

    def sample(self, rng: np.random.Generator) -> Array:
        """Draw a position around the start and the goal."""
        return rng.uniform(self.low, self.high)

    def steer(
        self, near: Array, target: Array, _goal: Array, count: int, rng: np.random.Generator, /
    ) -> Array:
        """Step straight to the target, and around that direction."""
        return blossom(near, target - near, STEP, count, rng)

    def is_within_step(self, a: Array, b: Array) -> bool:
        """Return whether two positions are within a step."""
        return bool(np.linalg.norm(a - b) <= STEP)


class PointProblem(PositionSpace):
    """Search for a path of the root alone, as a point: over the ground, outside the obstacles."""

    def __init__(self, scene: Scene, start: Array, goal: Array) -> None:
        super().__init__(start, goal, float(np.linalg.norm(goal - start)) + STEP)
        self.scene = scene

    def fails(self, _a: Array, b: Array, /) -> bool:
        """Return whether the root would be in the ground or in an obstacle."""
        is_under = b[2] < self.scene.ground.height(b[0], b[1])
        return bool(is_under) or any(o.contains(b) for o in self.scene.obstacles)
