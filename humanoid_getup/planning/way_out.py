"""The way out: a path of the root from under an obstacle to a place with room to stand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.motions.motion import Trajectory
from humanoid_getup.planning.collision import CollisionChecker, to_configuration
from humanoid_getup.planning.goal_placement import SUNK
from humanoid_getup.planning.posture_space import PositionSpace
from humanoid_getup.planning.rrt_blossom import SearchOptions, SearchStatus, search
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.standing_places import StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.body.parts import leg_length
from robots.kinematics import place
from robots.quaternion import Array

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
