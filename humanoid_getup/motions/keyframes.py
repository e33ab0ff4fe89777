"""Keyframes: motions as key postures, before any physics, and their transfer to other robots."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy  # which imports its parts when they are used

from humanoid_getup.motions.motion import STANDING, EndClass, StartClass, hold_last
from robots import Robot
from robots.body.limb_solver import LimbSolver
from robots.body.limbs import Limbs
from robots.quaternion import Array

STRETCHES, MOST_STRETCHES = 4, 50
SPEED_SHARE = 0.9  # of the servos' no-load speed, the bound of a target's speed


@dataclass(frozen=True, kw_only=True)
class Keyframes:
    """Key postures of one motion, in time."""

    name: str
    start_class: StartClass
    """Posture class it starts from: supine, prone, left, right, squat or standing."""
    end_class: EndClass = STANDING
    """What it ends in: a held stand, or the side on which the robot lies."""
    strategy: str
    """The strategy, in terms of biomechanics."""
    duration: Array
    """Time from each key to the next [s], shape (K-1,)."""
    keys: Array
    """Joint targets [rad], shape (K, n); the last of a rise is the standing posture."""
    free: np.ndarray
    """Joints that the optimization may change, shape (m,): left or unpaired ones."""
    mirrored: np.ndarray
    """Whether the right-hand partner of each free joint mirrors it, shape (m,)."""
    torque_limit: float
    """Torque limit of every servo in the optimization [N·m]."""
    time_cost: float
    """Cost of a second until the stand in the optimization."""
    torque_cost: float
    """Cost of a newton meter of RMS torque there."""

    def targets(self, robot: Robot, hold: float) -> Array:
        """Sample the joint targets at the control period, then hold the last, (T, n).

        A segment that would need targets faster than the servos is stretched.
        """
        _, curve, time = self._slow_down(robot, STRETCHES)
        moving = np.clip(curve(time), robot.lower, robot.upper)
        return hold_last(moving, len(moving) + round(hold / robot.control_period))

    def times(self, robot: Robot) -> Array:
        """Compute the times from the start at which `targets` reaches the keys [s], (K,)."""
        return np.concatenate([[0.0], np.cumsum(self._slow_down(robot, STRETCHES)[0])])

    def stretch(self, robot: Robot) -> Keyframes:
        """Give all segments the time that the servos need, so that none is stretched any more."""
        return replace(self, duration=self._slow_down(robot, MOST_STRETCHES)[0])

    def _slow_down(
        self, robot: Robot, rounds: int
    ) -> tuple[Array, scipy.interpolate.PchipInterpolator, Array]:
        """Stretch segments that are too fast; return durations, and the last curve, sampled at."""
        duration = self.duration
        curve, time, stretch = self._measure_speed(duration, robot)
        while np.any(stretch > 1.0) and (rounds := rounds - 1):
            duration = duration * np.maximum(1.0, stretch)
            curve, time, stretch = self._measure_speed(duration, robot)
        return duration, curve, time

    def _measure_speed(
        self, duration: Array, robot: Robot
    ) -> tuple[scipy.interpolate.PchipInterpolator, Array, Array]:
        """Return curve and sample times for durations, and each segment's speed over the bound."""
        knots = np.concatenate([[0.0], np.cumsum(duration)])
        curve = scipy.interpolate.PchipInterpolator(knots, self.keys, axis=0)
        time = np.arange(0.0, knots[-1] + robot.control_period, robot.control_period)
        time = np.minimum(time, knots[-1])
        excess = np.max(np.abs(curve(time, 1)) / (SPEED_SHARE * robot.max_velocity), axis=1)
        segment = np.minimum(np.searchsorted(knots, time, side="right") - 1, len(duration) - 1)
        stretch = np.zeros(len(duration))
        np.maximum.at(stretch, segment, excess)
        return curve, time, stretch

    @property
    def genes(self) -> Array:
        """Return the parameters of the optimization as a vector: log times, then angles [rad]."""
        return np.concatenate([np.log(self.duration), self.keys[1:-1, self.free].ravel()])

    def with_genes(self, genes: Array, robot: Robot) -> Keyframes:
        """Make the keyframes with other :attr:`genes`."""
        count = len(self.duration)
        keys = self.keys.copy()
        values = genes[count:].reshape(len(keys) - 2, len(self.free))
        keys[1:-1, self.free] = values
        paired, partner = self.free[self.mirrored], robot.mirror_index[self.free[self.mirrored]]
        keys[1:-1, partner] = values[:, self.mirrored] * robot.mirror_sign[paired]
        duration = np.exp(np.clip(genes[:count], math.log(0.08), math.log(2.0)))
        return replace(self, duration=duration, keys=np.clip(keys, robot.lower, robot.upper))


MOVES = math.radians(1.0)
"""Change between keys above which a joint counts as moved [rad]."""
STANCE = math.radians(0.05)


@dataclass(frozen=True)
class KeyTransfer:
    """Transfers keyframes from a source robot to a target.

    Every key is measured as the directions of upper and lower limbs and the attitude of the feet
    in the torso's frame; the target's limbs are pointed the same way, as near as their joints and
    ranges allow. Times grow with the square root of the height, as those of a pendulum do, and
    costs of times and torques shrink as these grow. Joints that are in no limb, like those of a
    head, stay in the target's stance.
    """

    source: Limbs
    target: Limbs

    @classmethod
    def between(cls, source: Robot, target: Robot) -> KeyTransfer:
        """Find the limbs of both."""
        return cls(Limbs(source), Limbs(target))

    @property
    def time_scale(self) -> float:
        """Return the target's time over the source's."""
        heights = [limbs.robot.standing_neck_height for limbs in self._both]
        return math.sqrt(heights[0] / heights[1])

    @property
    def torque_scale(self) -> float:
        """Return the target's load over the source's: weight times height."""
        loads = [limbs.mass * limbs.robot.standing_neck_height for limbs in self._both]
        return loads[0] / loads[1]

    def transfer(self, keyframes: Keyframes) -> Keyframes:
        """Transfer one motion."""
        robot = self.target.robot
        is_symmetric = bool(keyframes.mirrored.any())
        before, keys = robot.standing.joint_pos, []
        for key in keyframes.keys:
            if np.abs(key - self.source.robot.standing.joint_pos).max() < STANCE:
                before = robot.standing.joint_pos
            else:
                before = self._transfer_key(key, before)
            keys.append(self._symmetrize(before) if is_symmetric else before)
        if keyframes.end_class == STANDING:
            keys[-1] = robot.standing.joint_pos
        free = self._find_free(np.array(keys), is_symmetric)
        return replace(
            keyframes,
            duration=keyframes.duration * self.time_scale,
            keys=np.array(keys),
            free=free,
            mirrored=np.array(
                [is_symmetric and int(robot.mirror_index[k]) != k for k in free], dtype=bool
            ),
            torque_limit=self._scale_limit(keyframes.torque_limit),
            time_cost=round(keyframes.time_cost / self.time_scale, 3),
            torque_cost=round(keyframes.torque_cost / self.torque_scale, 3),
        )

    def _scale_limit(self, limit: float) -> float:
        """Scale a torque limit [N·m] by weight times leg length, and by the strength of the servos.

        The larger one is taken, within that strength: a robot with weaker servos for its weight
        needs a larger share of them.
        """
        full, source_full = (float(limbs.robot.max_torque.max()) for limbs in self._both)
        needs, source_needs = (limbs.mass * limbs.thigh_and_shank for limbs in self._both)
        return round(min(full, max(full * limit / source_full, limit * needs / source_needs)), 2)

    @property
    def _both(self) -> tuple[Limbs, Limbs]:
        return self.target, self.source

    def _transfer_key(self, key: Array, before: Array) -> Array:
        poses = self.source.measure(key)
        solver = LimbSolver(self.target)
        pointed = solver.solve(poses, before)
        ahead = self.source.measure_balance(key)
        return pointed if ahead is None else solver.solve_balance(ahead, pointed)

    def _symmetrize(self, key: Array) -> Array:
        """Give both sides the left one's angles."""
        robot, out = self.target.robot, key.copy()
        for limb in self.target.all.values():
            if limb.name.startswith("left"):
                for k in limb.joints:
                    out[robot.mirror_index[k]] = robot.mirror_sign[k] * key[k]
        return out

    def _find_free(self, keys: Array, is_symmetric: bool) -> np.ndarray:
        """Find the joints that the keys move; of a symmetric motion those on the left."""
        moved = np.flatnonzero(np.ptp(keys, axis=0) > MOVES)
        if not is_symmetric:
            return moved
        left = {
            k
            for limb in self.target.all.values()
            if limb.name.startswith("left")
            for k in limb.joints
        }
        paired = self.target.robot.mirror_index != np.arange(self.target.robot.n)
        return np.array([k for k in moved if k in left or not paired[k]], dtype=int)
