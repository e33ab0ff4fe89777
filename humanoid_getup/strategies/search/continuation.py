"""Continuation: chooses ends of failed rollouts from which another rise may succeed."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.filtering.candidate import CandidateRollout
from humanoid_getup.simulation.standing_places import StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.kinematics import read_posture
from robots.quaternion import Array

REST = 0.6  # s after a failed rollout until the next path begins
UNLIKE = 0.8  # cosine of the angle between attitudes that are alike
MOST_ENDS = 3


@dataclass(frozen=True, kw_only=True)
class End:
    """The end of a failed rollout at rest, and the targets that led there."""

    posture: Posture
    target: Array
    """Targets sent until then [rad], (T, n)."""
    confinement: float
    """Distance from the nearest place where the robot has room to stand [m]."""


class Continuation:
    """Picks the ends of failed rollouts from which another rise is tried."""

    def __init__(self, world: World, places: StandingPlaces | None) -> None:
        """Prepare for a world; ``places`` if it has any obstacles."""
        self._world, self._places = world, places
        self._waiting: list[End] = []

    def pick(self, tried: list[CandidateRollout]) -> list[End]:
        """Pick up to three ends of different attitudes; where there are obstacles, those with most
        room first.

        Among obstacles, ends that were not picked wait for the next time.
        """
        ends = [self._end(failed) for failed in tried if not failed.stood]
        if self._places is not None:
            ends = sorted([*self._waiting, *ends], key=lambda end: end.confinement)
        picked: list[End] = []
        for end in ends:
            if len(picked) < MOST_ENDS and not any(_are_alike(end, other) for other in picked):
                picked.append(end)
        self._waiting = [end for end in ends if not any(end is one for one in picked)]
        return picked

    def _end(self, failed: CandidateRollout) -> End:
        """Cut a rollout at the time from which the robot is at rest."""
        robot, model = self._world.robot, self._world.model
        length = min(failed.moving + round(REST / robot.control_period), len(failed.target))
        posture = read_posture(robot, model, failed.qpos[length - 1])
        places = self._places
        confinement = 0.0 if places is None else float(places.distance(posture.position))
        return End(posture=posture, target=failed.target[:length], confinement=confinement)


def _are_alike(a: End, b: End) -> bool:
    directions = [quaternion.gravity_in_body(end.posture.orientation) for end in (a, b)]
    return float(directions[0] @ directions[1]) >= UNLIKE
