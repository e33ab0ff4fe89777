"""Courses: sequences of paths, rests and stored motions, with targets for the servos."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.posture_metric import best_yaw
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import read_posture
from robots.quaternion import Array
from robots.smooth_step import smooth_step

BLEND = 0.32  # s over which the motion's load on the servos is blended in


@dataclass(frozen=True, kw_only=True)
class Course:
    """Postures and targets, one row for each control period."""

    position: Array
    """Root position in the world [m], (T, 3)."""
    orientation: Array
    """Root orientation in the world, w x y z, (T, 4)."""
    joint_pos: Array
    """Joint angles [rad], (T, n)."""
    joint_target: Array
    """Target angles of the servos [rad], (T, n)."""

    @classmethod
    def at(cls, posture: Posture) -> Course:
        """Begin in a posture at rest, without load."""
        angles = posture.joint_pos[None]
        position, orientation = posture.position[None], posture.orientation[None]
        return cls(
            position=position, orientation=orientation, joint_pos=angles, joint_target=angles
        )

    @classmethod
    def of(cls, path: Trajectory, joint_target: Array | None = None) -> Course:
        """Take a path that is sampled at the control period; its targets are its angles if None."""
        return cls(
            position=path.position,
            orientation=path.orientation,
            joint_pos=path.joint_pos,
            joint_target=path.joint_pos if joint_target is None else joint_target,
        )

    @classmethod
    def tracking(cls, path: Trajectory, robot: Robot) -> Course:
        """Take a path whose targets compensate the servos' back-EMF.

        A position servo that follows a speed v stays ``(K²/R) / kp * v`` behind its target. This is
        velocity-driven tracking for position servos: v_d = v_ref + (kp R / K²) (q_ref - q).
        """
        speed = np.zeros_like(path.joint_pos)
        if len(path.time) > 1:
            speed = np.gradient(path.joint_pos, robot.control_period, axis=0)
        return cls.of(path, path.joint_pos + robot.compute_lag(speed))

    @classmethod
    def entering(
        cls, motion: Motion, frame: int, posture: Posture, target: Array, period: float
    ) -> Course:
        """Enter a motion at a frame, from a posture whose servos have targets [rad], (n,)."""
        targets = join(motion, frame, target, period)
        rows = np.minimum(np.arange(len(targets)) + frame, len(motion.time) - 1)
        return replace(cls.aligned(motion, frame, posture)[rows], joint_target=targets)

    @classmethod
    def aligned(
        cls, motion: Motion, frame: int, posture: Posture, *, keep_height: bool = True
    ) -> Course:
        """Turn and shift a motion so that its frame has a posture's place and heading.

        Heights are the motion's own, or else those that lead on from the posture's.
        """
        turn = quaternion.from_yaw(best_yaw(motion.orientation[frame], posture.orientation))
        offset = motion.position - motion.position[frame]
        position = quaternion.rotate(turn, offset)
        position[:, :2] += posture.position[:2]
        above = motion.position[:, 2] if keep_height else posture.position[2] + offset[:, 2]
        position[:, 2] = above
        return cls(
            position=position,
            orientation=quaternion.multiply(turn, motion.orientation),
            joint_pos=motion.joint_pos,
            joint_target=motion.joint_target,
        )

    def __len__(self) -> int:
        return len(self.joint_pos)

    def __getitem__(self, rows: slice | NDArray[np.intp]) -> Course:
        """Return some of the rows."""
        return Course(**{name: array[rows] for name, array in self._arrays()})

    @property
    def end(self) -> Posture:
        """Return the posture at its end."""
        return Posture(
            position=self.position[-1],
            orientation=quaternion.normalize(self.orientation[-1]),
            joint_pos=self.joint_pos[-1],
        )

    @property
    def load(self) -> Array:
        """Return the lead of targets over angles by the load at its end [rad], (n,)."""
        return self.joint_target[-1] - self.joint_pos[-1]

    def then(self, further: Course) -> Course:
        """Append further rows."""
        pairs = zip(self._arrays(), further._arrays(), strict=True)
        return Course(**{name: np.concatenate([a, b]) for (name, a), (_, b) in pairs})

    def follow(self, path: Trajectory, robot: Robot) -> Course:
        """Follow a path from the end, at rest at both ends; its targets lead by the load, too."""
        added = Course.tracking(path, robot)[1:]
        return self.then(replace(added, joint_target=added.joint_target + self.load))

    def play(self, motion: Motion, first: int, last: int | None, period: float) -> Course:
        """Play a motion from one frame to another, or its end; its load fades in."""
        entered = Course.entering(motion, first, self.end, self.joint_target[-1], period)
        return self.then(entered[1 : None if last is None else last - first + 1])

    def rest(self, duration: float, period: float) -> Course:
        """Hold posture and load for a time [s]."""
        count = round(duration / period)
        held = {name: np.tile(array[-1], (count, 1)) for name, array in self._arrays()}
        held["joint_target"] = np.tile(self.joint_pos[-1] + self.load, (count, 1))
        return self.then(Course(**held))

    def to_trajectory(self, period: float) -> Trajectory:
        """Return the postures over time."""
        return Trajectory(
            time=np.arange(len(self), dtype=float) * period,
            position=self.position,
            orientation=self.orientation,
            joint_pos=self.joint_pos,
        )

    def to_motion(self, like: Motion, period: float, **changes: Any) -> Motion:
        """Make a motion of it, which is like the one that it ends with but for some changes."""
        return replace(
            like,
            time=np.arange(len(self), dtype=float) * period,
            position=self.position,
            orientation=quaternion.normalize(self.orientation),
            joint_pos=self.joint_pos,
            joint_target=self.joint_target,
            entry=np.zeros(0, dtype=bool),
            **changes,
        )

    def _arrays(self) -> list[tuple[str, Array]]:
        return [(field.name, getattr(self, field.name)) for field in fields(self)]


def join(motion: Motion, frame: int, joint_pos: Array, period: float) -> Array:
    """Compute the targets that enter a motion at a frame, (T, n).

    The initial lead of the motion's targets over the joint angles ``joint_pos``, which is
    the load on the servos there, is blended in smoothly.
    """
    time = np.arange(motion.time[frame], motion.time[-1] + 0.5 * period, period)
    share = smooth_step((time - time[0]) / BLEND)[:, None]
    return motion.sample(time) - (1.0 - share) * (motion.joint_target[frame] - joint_pos)


def record_motion(
    world: World, start: Posture, target: Array, qpos: Array, **fields: Any
) -> Motion:
    """Make a motion from sent targets and recorded postures.

    Targets at each control period [rad] are (T, n), the MuJoCo positions at its end
    (T or more, nq); ``fields`` are all else of the motion.
    """
    robot, went = world.robot, qpos[: len(target) - 1]
    return Motion.through(
        [start, *(read_posture(robot, world.model, q) for q in went)],
        robot.control_period,
        robot=robot.name,
        joint_target=target,
        **fields,
    )
