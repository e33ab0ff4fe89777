"""Candidates: a path with a motion, the reference to track for it, and its rollout."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion, Trajectory, hold_last
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.posture_metric import best_yaw
from humanoid_getup.simulation.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion
from robots.kinematics import center_of_mass
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Slowdown:
    """How a motion slows down for servos that lag behind their targets.

    A servo under load stays behind its target by its torque over its stiffness; beyond the largest
    torque it does not follow at all, and a motion that continues regardless leaves the robot
    behind. So the motion runs the more slowly, the farther the slowest joint is behind.
    """

    tolerance: float
    """Lag up to which the motion runs at its own speed [rad]."""
    band: float
    """Lag beyond that at which it would stop [rad]."""
    slowest: float
    """Smallest speed, as a share of its own."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A path and a motion to be rolled out."""

    path: Trajectory
    """From the lying posture to the connecting one."""
    connection: Connection
    tempo: float = 1.0
    """Speed of the path as a share of the planned one."""
    slowdown: Slowdown | None = None
    """How it slows down for servos that lag behind; ``None``: not at all."""
    assistance: float = 1.0
    """Share of the filter's virtual actuator; 0 is plain tracking."""
    before: Array | None = None
    """Targets to send first [rad], (T, n): those of an earlier rollout, at whose end the path
    begins."""
    seen: Array | None = None
    """Positions and orientations (K, 7) of the root in an earlier rollout, from where the motion
    is joined: where the legs fit the ground."""
    fits: bool = False
    """Whether the motion was made on this ground, and legs are not fitted to it."""


@dataclass(frozen=True, kw_only=True)
class CandidateRollout:
    """Rollout of a candidate."""

    candidate: Candidate
    outcome: Outcome
    """A stand of one second counts in it; a check requires more."""
    cost: float
    """By the filter's preference [s]; nan if it did not stand."""
    moving: int
    """Cycles before the targets stand still."""
    joined: int
    """Cycle at which the motion was joined."""
    stood: bool
    """Whether it ended upright for a second, and no servo was overloaded."""
    collides: bool
    """Whether the robot touched itself firmly."""
    peak_neck: float
    """Greatest neck height reached [m]."""
    target: Array
    """Targets that the servos were sent [rad], (T, n)."""
    overlap: Array
    """Depth of self-penetration [m], (T,)."""

    @property
    def qpos(self) -> Array:
        """MuJoCo positions, (T, nq)."""
        return self.outcome.record.qpos

    def measure_overlap(self, touch: float) -> float:
        """Sum the depths of self-overlap beyond a touch [m]."""
        return float(np.maximum(self.overlap - touch, 0.0).sum())


NO_SLOWDOWN = Slowdown(tolerance=np.inf, band=1.0, slowest=1.0)


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Targets to send, and the desired motion of the center of mass."""

    target: Array
    """Joint targets [rad], one a control period, (T, n)."""
    com: Array
    """Center of mass in the world [m], (T, 3)."""
    joined: int
    """Cycle at which the database motion begins."""
    begins: int = 0
    """Cycle at which the path begins; before it the targets are those of an earlier rollout."""

    def after(self, target: Array) -> Reference:
        """Prepend the targets (T, n) of an earlier rollout to this reference."""
        waiting = np.repeat(self.com[:1], len(target), axis=0)
        return Reference(
            target=np.concatenate([target, self.target]),
            com=np.concatenate([waiting, self.com]),
            joined=self.joined + len(target),
            begins=len(target),
        )


RAMP = 0.3  # s in which the legs fit the ground that is there


def straight_path(start: Posture, goal: Posture, speed: float, period: float) -> Trajectory:
    """Interpolate between two postures linearly, at constant joint speed, without planning."""
    travel = float(np.max(np.abs(goal.joint_pos - start.joint_pos), initial=0.0))
    steps = max(2, round(travel / speed / period))
    share = np.linspace(0.0, 1.0, steps + 1)
    return Trajectory(
        time=share * steps * period,
        position=start.position + share[:, None] * (goal.position - start.position),
        orientation=quaternion.slerp(start.orientation[None], goal.orientation[None], share),
        joint_pos=start.joint_pos + share[:, None] * (goal.joint_pos - start.joint_pos),
    )


def compose(
    world: World,
    path: Trajectory,
    motion: Motion,
    frame: int,
    tempo: float = 1.0,
    fit: GroundFit | None = None,
    seen: Array | None = None,
    *,
    fits: bool = False,
) -> Reference:
    """Chain a path and a motion from a frame on into one reference, lying to stand.

    The path is played at ``tempo``, a share of its own speed; in the motion, the lead over the
    servos' back-EMF is that of its own targets, blended in. Legs are fitted to ground that is not
    level, unless the motion ``fits`` it.
    """
    robot, period = world.robot, world.robot.control_period
    path = resample(path, tempo, period)
    approach = Course.tracking(path, robot)
    entered = Course.entering(motion, frame, path.posture(-1), path.joint_pos[-1], period)
    at = (entered.position, entered.orientation)
    if seen is not None:
        at = _follow(*at, seen)
    ramp = np.minimum(np.arange(len(entered)) * period / RAMP, 1.0)[:, None]
    if not fits:
        shift = ramp * (fit or GroundFit(world)).shift(*at, entered.joint_pos)
        entered = replace(entered, joint_target=entered.joint_target + shift)
    whole = approach.then(entered)
    com = center_of_mass(robot, world.model, whole.position, whole.orientation, whole.joint_pos)
    return Reference(target=whole.joint_target, com=com, joined=len(approach))


def _follow(position: Array, orientation: Array, seen: Array) -> tuple[Array, Array]:
    """Move postures of a motion (T, ...) to the root's path in a rollout of it."""
    seen = hold_last(seen[: len(position)], len(position))
    place = np.concatenate([seen[:, :2], position[:, 2:]], axis=1)
    yaw = best_yaw(orientation, seen[:, 3:])
    return place, quaternion.multiply(quaternion.from_yaw(yaw), orientation)


def resample(path: Trajectory, tempo: float, period: float) -> Trajectory:
    """Scale the speed of a path, and sample it at the control period again."""
    if tempo == 1.0:
        return path
    duration = path.time[-1] / tempo
    time = np.linspace(0.0, duration, max(2, round(duration / period) + 1))
    at = time * tempo
    columns = [
        np.stack([np.interp(at, path.time, column) for column in array.T], axis=1)
        for array in (path.position, path.orientation, path.joint_pos)
    ]
    return Trajectory(
        time=time,
        position=columns[0],
        orientation=quaternion.normalize(columns[1]),
        joint_pos=columns[2],
    )
