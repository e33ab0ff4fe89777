"""Key transfer: keyframes of one robot for another, with limbs in the same directions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import STANDING
from robots import Robot
from robots.body.limb_solver import LimbSolver
from robots.body.limbs import Limbs
from robots.quaternion import Array

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
        """Find the limbs of both.

        Raises:
            ValueError: if one of them has no two legs with a knee.
        """
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
