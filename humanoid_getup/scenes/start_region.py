"""Start regions: places and ways of lying of robots in a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robots import Posture, quaternion
from robots.quaternion import Array

Range = tuple[float, float]

SPREAD = math.radians(15.0)  # of the orientation in which a robot is dropped, each axis
WIDENED = np.array([1.0, 1.0, 0.0])  # axes on which a margin counts
DRIFT = math.radians(30.0)  # by which its heading may leave the range while it settles


@dataclass(frozen=True, kw_only=True)
class StartRegion:
    """A region of a scene in which robots lie in one way."""

    start_class: str | None = None
    """supine, prone, left or right; None for any."""
    x: Range = (0.0, 0.0)
    """Range in which the torso is dropped [m]."""
    y: Range = (0.0, 0.0)
    z: Range = (-math.inf, math.inf)
    """Range of the height of the torso, to distinguish under a table from on it [m]."""
    margin: float = 0.0
    """Distance by which the torso may leave the region while the robot settles [m]."""
    is_settled: bool = False
    """Whether robots settle on the bare ground first and are then put in the region, because no
    robot falls there, such as under a table."""
    heading: Range = (-math.pi, math.pi)
    """Horizontal direction in which the head points [rad], 0 along +x."""

    def sample(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw the place [m], (2,), and orientation, (4,), of a dropped robot."""
        if self.start_class is None:
            orientation = quaternion.normalize(rng.normal(size=4))
            return self._draw_place(rng) if self._has_place else np.zeros(2), orientation
        place = self._draw_place(rng)
        heading, spread = rng.uniform(*self.heading), rng.normal(0.0, SPREAD, 3)
        turned = quaternion.multiply(quaternion.from_yaw(heading), lying(self.start_class))
        axis = spread / max(float(np.linalg.norm(spread)), 1e-12)
        shaken = quaternion.from_axis_angle(axis, float(np.linalg.norm(spread)))
        return place, quaternion.normalize(quaternion.multiply(turned, shaken))

    @property
    def _has_place(self) -> bool:
        """Return whether robots lie at another place than the origin."""
        return (*self.x, *self.y) != (0.0, 0.0, 0.0, 0.0)

    def _draw_place(self, rng: np.random.Generator) -> Array:
        return np.array([rng.uniform(*self.x), rng.uniform(*self.y)])

    def move(self, posture: Posture, rng: np.random.Generator) -> Posture:
        """Move a lying robot to a place in the region, with a heading of the region."""
        heading = rng.uniform(*self.heading)
        return lay_at(posture, self._draw_place(rng), heading)

    def spans(self, position: Array) -> bool:
        """Return whether a torso's position [m], (3,), is in the region or its margin."""
        if self.start_class is None and not self._has_place:
            return True
        low, high = np.array([self.x, self.y, self.z]).T
        low, high = low - self.margin * WIDENED, high + self.margin * WIDENED
        return bool(np.all((position >= low) & (position <= high)))

    def accepts(self, posture: Posture, start_class: str) -> bool:
        """Return whether a settled robot lies in the class and the region."""
        if self.start_class is None:
            return True
        low, high = self.heading
        off = math.remainder(_find_heading(posture) - 0.5 * (low + high), 2.0 * math.pi)
        is_there = start_class == self.start_class and self.spans(posture.position)
        return is_there and abs(off) <= 0.5 * (high - low) + DRIFT


ANYWHERE = StartRegion()


def lay_at(posture: Posture, place: Array, heading: float) -> Posture:
    """Move a lying robot to a place (2,) [m], and turn its head to a heading [rad]."""
    turn = quaternion.from_yaw(heading - _find_heading(posture))
    return replace(
        posture,
        position=np.array([*place, posture.position[2]]),
        orientation=quaternion.normalize(quaternion.multiply(turn, posture.orientation)),
    )


def _find_heading(posture: Posture) -> float:
    """Find the horizontal direction in which the head of a lying robot points [rad]."""
    head = quaternion.rotate(posture.orientation, np.array([0.0, 0.0, 1.0]))
    return math.atan2(head[1], head[0])


def lying(start_class: str) -> Array:
    """Return the orientation of a torso that lies in a class, its head along +x, (4,)."""
    down = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.5 * math.pi)  # face down
    turn = {"prone": 0.0, "supine": math.pi, "left": -0.5 * math.pi, "right": 0.5 * math.pi}
    about_spine = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), turn[start_class])
    return quaternion.multiply(down, about_spine)
