"""Smoothing of paths: shortcuts, cubic Bezier curves and their timing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.planning.posture_space import PostureProblem
from robots import quaternion
from robots.quaternion import Array

SAMPLES = 24  # of each piece of the curve
SHARPEST = 0.05  # below this roundness a corner is not rounded at all
GAIN = 0.01  # of the metric; a segment that would be shortened by less stays


def shorten(
    problem: PostureProblem, path: list[Array], rng: np.random.Generator, rounds: int
) -> list[Array]:
    """Replace segments of a path by straight ones where those are free.

    First the whole path is tried, then segments between pairs of points drawn from anywhere
    on it, one in each round; then every node is dropped whose neighbors can be joined. A
    shorter path is a faster rise.
    """
    if not problem.fails(path[0], path[-1]):
        return [path[0], path[-1]]
    for _ in range(rounds):
        way = _ways(problem, path)
        low, high = np.sort(rng.uniform(0.0, way[-1], size=2))
        (i, a), (j, b) = _cut(problem, path, way, low), _cut(problem, path, way, high)
        gain = high - low - float(problem.distance(a[None], b)[0])
        if i < j and gain > GAIN and not problem.fails(a, b):
            path = [*path[: i + 1], a, b, *path[j + 1 :]]
    return _drop_needless(problem, path)


def length(problem: PostureProblem, path: list[Array]) -> float:
    """Compute the length of a path in the metric."""
    return float(_ways(problem, path)[-1])


def _ways(problem: PostureProblem, path: list[Array]) -> Array:
    """Compute how far along the path its nodes lie, (K,)."""
    steps = [float(problem.distance(b[None], a)[0]) for a, b in pairwise(path)]
    return np.concatenate([[0.0], np.cumsum(steps)])


def _cut(problem: PostureProblem, path: list[Array], way: Array, at: float) -> tuple[int, Array]:
    """Find the edge and the point that lie ``at`` along the path."""
    edge = min(int(np.searchsorted(way, at, side="right")) - 1, len(path) - 2)
    share = (at - way[edge]) / max(way[edge + 1] - way[edge], 1e-12)
    return edge, problem.blend(path[edge], path[edge + 1], np.array([share]))[0]


def _drop_needless(problem: PostureProblem, path: list[Array]) -> list[Array]:
    kept = [path[0]]
    for k in range(1, len(path) - 1):
        if problem.fails(kept[-1], path[k + 1]):
            kept.append(path[k])
    return [*kept, path[-1]]


@dataclass(frozen=True, kw_only=True)
class SpeedLimits:
    """Speed limits along a path."""

    joint_speed: Array
    """Largest speed of each joint [rad/s], shape (n,)."""
    turn_rate: float = 4.0
    """Largest angular speed of the root [rad/s]."""
    ease: float = 0.15
    """Time of acceleration at the start and of deceleration at the end [s]."""
    period: float
    """Sample time [s]."""


@dataclass(frozen=True)
class Curve:
    """A smooth path, finely sampled."""

    nodes: Array
    """Orientation and joint angles in a row, shape (S, 4 + n)."""
    corner: NDArray[np.intp]
    """The node of the path around which each sample was rounded, (S,); 0 on a straight."""


def smooth(path: list[Array], roundness: Array) -> Curve:
    """Round a path of postures by cubic Bezier curves.

    Every inner node of the path draws one cubic piece from the edge before it to the
    edge after it, with the node as control point of both its tangents (the postures are the
    control points [Lin12], section 4.3). Pieces begin and end along the edges, so the curve
    has no kink; it begins and ends exactly in the first and last node. Straight pieces join
    them.

    Args:
        path: Orientation and joint angles in a row, K nodes (4 + n,).
        roundness: Share of its half edges that each node rounds off, shape (K,): at 1 the
            curve runs from edge middle to edge middle, at 0 through the node itself.
    """
    nodes = _turn_to_one_side(np.array(path))
    first, last = nodes[:1], nodes[-1:]
    corner, before, after = nodes[1:-1], nodes[:-2], nodes[2:]
    share = 0.5 * roundness[1:-1, None]
    arc_begin, arc_end = _blend(corner, before, share), _blend(corner, after, share)  # (K - 2, d)
    rounds = [
        arc_begin,
        _blend(arc_begin, corner, np.array(2.0 / 3.0)),
        _blend(arc_end, corner, np.array(2.0 / 3.0)),
        arc_end,
    ]
    begin, end = np.concatenate([first, arc_end]), np.concatenate([arc_begin, last])
    straights = [_blend(begin, end, np.array(k / 3.0)) for k in range(4)]  # (K - 1, d) each
    u = np.linspace(0.0, 1.0, SAMPLES + 1)[1:, None, None]
    samples, owner = [first], [np.zeros(1, dtype=np.intp)]
    lines, arcs = _bezier(straights, u), _bezier(rounds, u)  # (SAMPLES, pieces, d)
    for k in range(len(nodes) - 1):
        samples.append(lines[:, k])
        owner.append(np.zeros(SAMPLES, dtype=np.intp))
        if k < len(nodes) - 2:
            samples.append(arcs[:, k])
            owner.append(np.full(SAMPLES, k + 1))
    return Curve(np.concatenate(samples), np.concatenate(owner))


def retime(curve: Curve, limits: SpeedLimits) -> tuple[Array, Array, NDArray[np.intp]]:
    """Follow a curve as fast as possible: on the way a joint or the root is always at its limit.

    Departure from [Lin12], section 4.3, whose speed is constant from end to end: a servo
    cannot jump to a speed, so the curve begins and ends with ``limits.ease``.

    Returns:
        Times (T,) [s], nodes (T, 4 + n), and for each the sample of the curve it follows, (T,).
    """
    a, b = curve.nodes[:-1], curve.nodes[1:]
    bend = np.max(np.abs(b[:, 4:] - a[:, 4:]) / limits.joint_speed, axis=1)
    turn = quaternion.angle_between(a[:, :4], b[:, :4]) / limits.turn_rate
    clock = np.concatenate([[0.0], np.cumsum(np.maximum(bend, turn))])  # s at full speed
    ease = min(limits.ease, clock[-1])
    frames = math.ceil((clock[-1] + ease) / limits.period - 1e-9)
    time = limits.period * np.arange(frames + 1)
    # Stretched to whole periods, hence a little below the limits.
    at = _ease(time * (clock[-1] + ease) / max(time[-1], 1e-12), clock[-1], ease)
    at = np.clip(at, 0.0, clock[-1])
    after = np.clip(np.searchsorted(clock, at), 1, len(clock) - 1)
    leg = np.maximum(clock[after] - clock[after - 1], 1e-12)
    share = np.clip((at - clock[after - 1]) / leg, 0.0, 1.0)[:, None]
    nodes = _blend(curve.nodes[after - 1], curve.nodes[after], share)
    nodes[0], nodes[-1] = curve.nodes[0], curve.nodes[-1]
    return time, nodes, after


def smooth_free(
    path: list[Array], limits: SpeedLimits, is_free: Callable[[Array], bool]
) -> tuple[Array, Array, int]:
    """Round and time a path; a corner is rounded less if that would cause a collision.

    Returns:
        Times (T,) [s], nodes (T, 4 + n), and how many of them still collide.
    """
    roundness = np.ones(len(path))
    while True:
        curve = smooth(path, roundness)
        time, nodes, sample = retime(curve, limits)
        colliding = np.array([not is_free(node) for node in nodes])
        corners = np.unique(curve.corner[sample[colliding]])
        corners = corners[(corners > 0) & (roundness[corners] > 0.0)]
        if len(corners) == 0:
            return time, nodes, int(colliding.sum())
        roundness[corners] *= 0.5
        roundness[roundness < SHARPEST] = 0.0


def _bezier(control: list[Array], u: Array) -> Array:
    """Evaluate cubic pieces by de Casteljau's algorithm, quaternions by slerp, (S, pieces, d).

    Each of four ``control`` points has shape (pieces, d), the parameters ``u`` (S, 1, 1).
    """
    while len(control) > 1:
        control = [_blend(a, b, u) for a, b in pairwise(control)]
    return control[0]


def _blend(a: Array, b: Array, share: Array) -> Array:
    """Interpolate between nodes (..., 4 + n): slerp and straight line."""
    turned = quaternion.slerp(
        a[..., :4], b[..., :4], np.squeeze(share, -1) if share.ndim else share
    )
    bent = a[..., 4:] + share * (b[..., 4:] - a[..., 4:])
    return np.concatenate([turned, bent], axis=-1)


def _turn_to_one_side(nodes: Array) -> Array:
    """Choose each of ``q`` and ``-q`` so that neighbors are less than half a turn apart."""
    dot = np.sum(nodes[1:, :4] * nodes[:-1, :4], axis=1)
    sign = np.cumprod(np.concatenate([[1.0], np.where(dot < 0.0, -1.0, 1.0)]))
    return np.concatenate([nodes[:, :4] * sign[:, None], nodes[:, 4:]], axis=1)


def _ease(time: Array, distance: float, ease: float) -> Array:
    """Compute the distance after a time at unit speed, eased in and out.

    The speed is (1 - cos(pi t / ease)) / 2 at first and the mirror image of it at last,
    so the whole takes ``distance + ease``.
    """
    if ease <= 0.0:
        return time
    whole = distance + ease
    early, late = np.clip(time, 0.0, ease), np.clip(whole - time, 0.0, ease)
    swell = [0.5 * (t - ease / np.pi * np.sin(np.pi * t / ease)) for t in (early, late)]
    return np.where(
        time <= 0.5 * whole,
        swell[0] + np.maximum(time - ease, 0.0),
        distance - swell[1] - np.maximum(whole - time - ease, 0.0),
    )
