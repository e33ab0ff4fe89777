"""Places in a scene: for postures of motions made on level ground, and out from under obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.collision import CollisionChecker, to_configuration
from humanoid_getup.planning.posture_space import PositionSpace
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchStatus, search
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.placement import StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.body.parts import leg_length
from robots.kinematics import place
from robots.quaternion import Array

SUNK = 0.002  # m that a robot at rest sinks into what it lies on
HIGHEST = 0.25  # leg lengths by which what is under a posture may raise it
DISTANCES = (0.25, 0.5, 0.75, 1.0)  # leg lengths from the start to further places
DIRECTIONS = 8
UP = np.array([0.0, 0.0, 1.0])


class GoalPlacement:
    """Puts connecting postures on the ground or on obstacles, at the start or beside it."""

    def __init__(self, world: World) -> None:
        self._world, self._scene = world, world.scene
        self._clearance = Clearance(world)
        self._leg = leg_length(world.robot)

    def place(self, posture: Posture, start: Posture) -> Posture | None:
        """Put a posture at the place nearest to a start where it fits; ``None`` if there is none.

        It is turned to the start, tilted as the ground under it, and lowered until it rests.
        """
        if self._scene.is_flat:
            return align(posture, start)
        found = (self._put(posture, start, offset) for offset in self._offsets())
        return next((goal for goal in found if goal is not None), None)

    def _offsets(self) -> Iterator[Array]:
        yield np.zeros(2)
        angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        for distance in DISTANCES:
            yield from distance * self._leg * ring

    def _put(self, posture: Posture, start: Posture, offset: Array) -> Posture | None:
        """Put a posture beside a start by an offset (2,) [m]; ``None`` if it does not fit."""
        robot, model = self._world.robot, self._world.model
        goal = align(posture, start)
        at = np.array([*(start.position[:2] + offset), start.position[2]])
        under = float(self._scene.support(at))
        goal = replace(
            goal,
            position=np.array([*at[:2], under + posture.position[2]]),
            orientation=quaternion.multiply(self._tilt(at, under), goal.orientation),
        )
        rested = self._clearance.rest(place(robot, model, goal), -SUNK, under)
        layout = robot.layout(model)
        position = rested[layout.root_position].copy()
        if abs(position[2] - goal.position[2]) > HIGHEST * self._leg:
            return None
        return replace(goal, position=position)

    def _tilt(self, at: Array, under: float) -> Array:
        """Compute the rotation from level ground to that at a place (3,), (4,)."""
        x, y = at[:2]
        if under > float(self._scene.ground.height(x, y)) + SUNK:
            return np.array([1.0, 0.0, 0.0, 0.0])  # on an obstacle, whose top is taken as level
        normal = self._scene.ground.normal(x, y, 0.5 * self._leg)
        axis = np.cross(UP, normal)
        sine = float(np.linalg.norm(axis))
        if sine < 1e-9:
            return np.array([1.0, 0.0, 0.0, 0.0])
        return quaternion.from_axis_angle(axis / sine, float(np.arctan2(sine, normal[2])))


DEEP = 0.5  # leg lengths from where a standing robot just fits: farther in, it is under something
SPACING = 0.01  # m between the checks along an edge
SPEED = 0.2  # m/s of the root
MOST_PLACES = 12  # the nearest ones, to which a way is searched
OPTIONS = SearchOptions(max_edges=400)


@dataclass(frozen=True, kw_only=True)
class WayOut:
    """A path of the root alone: orientation and joint angles stay as they are."""

    start: Posture
    positions: Array
    """Positions of the root [m], (K, 3), from the start to a place with room."""

    @property
    def end(self) -> Posture:
        """Return the posture at the end."""
        return replace(self.start, position=self.positions[-1])

    @property
    def length(self) -> float:
        """Return the length of the path [m]."""
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())

    def sample(self, checker: CollisionChecker) -> Trajectory:
        """Sample the path at 0.2 m/s, the robot raised where it would penetrate something."""
        period = checker.robot.control_period
        legs = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        way = np.concatenate([[0.0], np.cumsum(legs)])
        count = max(1, math.ceil(way[-1] / (SPEED * period)))
        at = np.linspace(0.0, way[-1], count + 1)
        position = np.stack([np.interp(at, way, axis) for axis in self.positions.T], axis=1)
        fixed = to_configuration(self.start)[3:]
        position[:, 2] += [checker.lift(np.concatenate([p, fixed])) for p in position]
        return Trajectory(
            time=np.arange(count + 1, dtype=float) * period,
            position=position,
            orientation=np.tile(self.start.orientation, (count + 1, 1)),
            joint_pos=np.tile(self.start.joint_pos, (count + 1, 1)),
        )


def find_way_out(
    world: World, checker: CollisionChecker, start: Posture, rng: np.random.Generator
) -> WayOut | None:
    """Find a way out for a robot that lies far from any place with room to stand.

    [Lin12], section 4.2.1, plans the root's position first and, as this does, without regard to
    what could push the robot there; here with the whole body in its posture instead of a point.
    A servo robot cannot follow such a path: a rise crawls there
    (`humanoid_getup.posture_chains.crawl_search`).

    Returns:
        ``None`` where none is needed, or none was found.
    """
    leg = leg_length(world.robot)
    if not world.scene.obstacles:
        return None
    places = StandingPlaces(world, start.position)
    if not places.exist or places.distance_to_any(start.position) <= DEEP * leg:
        return None
    checker.reset()
    if checker.allow(start):
        return None
    for at in places.find_nearest(start.position, MOST_PLACES):
        end = _rest(world, start, at)
        problem = ShiftProblem(checker, start, end)
        if problem.is_free(end):
            found = search(problem, start.position, end, rng, OPTIONS)
            if found.status is SearchStatus.SOLVED:
                return WayOut(start=start, positions=np.array(found.path))
    return None


def _rest(world: World, start: Posture, at: Array) -> Array:
    """Put a posture on the ground or an obstacle at a place (2,); return its position (3,)."""
    moved = replace(start, position=np.array([*at, start.position[2]]))
    qpos = Clearance(world).rest_where(place(world.robot, world.model, moved), -SUNK)
    return qpos[world.robot.layout(world.model).root_position].copy()


class ShiftProblem(PositionSpace):
    """Search for a path of a robot that keeps its posture, no higher than start and goal."""

    def __init__(self, checker: CollisionChecker, posture: Posture, goal: Array) -> None:
        apart = float(np.linalg.norm(goal - posture.position))
        super().__init__(posture.position, goal, apart * np.array([1.0, 1.0, 0.0]))
        self._checker, self._fixed = checker, to_configuration(posture)

    def steer(
        self, near: Array, target: Array, goal: Array, count: int, rng: np.random.Generator, /
    ) -> Array:
        """Step straight to the target, and around that direction."""
        return np.clip(super().steer(near, target, goal, count, rng), self.low, self.high)

    def fails(self, a: Array, b: Array, /) -> bool:
        """Return whether the robot collides between two positions."""
        count = max(1, math.ceil(float(np.linalg.norm(b - a)) / SPACING))
        between = a + np.arange(1, count + 1)[:, None] / count * (b - a)
        return not all(self.is_free(position) for position in between[::-1])

    def is_free(self, position: Array) -> bool:
        """Return whether the robot collides with nothing at a position."""
        return self._checker.is_free(np.concatenate([position, self._fixed[3:]]))
