"""Choreographies: rising motions as authored key postures, before any physics."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from robots import Robot
from robots.quaternion import Array

SPEED_SHARE = 0.9  # of the servos' no-load speed, the most a target may move


@dataclass(frozen=True, kw_only=True)
class Keyframes:
    """Key postures of one rising motion, in time."""

    name: str
    start_class: str
    """Posture class it starts from: supine, prone, left, right or squat."""
    strategy: str
    """The strategy in biomechanics' terms."""
    duration: Array
    """Time from each key to the next [s], shape (K-1,)."""
    keys: Array
    """Joint targets [rad], shape (K, n); the last is the standing posture."""
    free: np.ndarray
    """Joints that an improvement may change, shape (m,): left or unpaired ones."""
    mirrored: np.ndarray
    """Whether each free joint carries its right-hand partner along, shape (m,)."""
    torque_limit: float
    """Cap on the servos under which an improvement rehearses it [N·m]."""
    time_cost: float
    """What a second until the stand costs in an improvement."""
    torque_cost: float
    """What a newton meter of RMS torque costs there."""

    def targets(self, robot: Robot, hold: float) -> Array:
        """Sample the joint targets at the control period, then hold the last, (T, n).

        A segment that would need targets faster than the servos is stretched.
        """
        duration, limit = self.duration.copy(), SPEED_SHARE * robot.max_velocity
        for _ in range(4):
            knots = np.concatenate([[0.0], np.cumsum(duration)])
            curve = PchipInterpolator(knots, self.keys, axis=0)
            time = np.arange(0.0, knots[-1] + robot.control_period, robot.control_period)
            time = np.minimum(time, knots[-1])
            excess = np.max(np.abs(curve(time, 1)) / limit, axis=1)
            segment = np.minimum(np.searchsorted(knots, time, side="right") - 1, len(duration) - 1)
            stretch = np.array(
                [excess[segment == i].max(initial=0.0) for i in range(len(duration))]
            )
            if np.all(stretch <= 1.0):
                break
            duration = duration * np.maximum(1.0, stretch)
        moving = np.clip(curve(time), robot.lower, robot.upper)
        resting = np.repeat(moving[-1:], round(hold / robot.control_period), axis=0)
        return np.concatenate([moving, resting])

    @property
    def genes(self) -> Array:
        """Return what an improvement may change as one vector: log times, then angles [rad]."""
        return np.concatenate([np.log(self.duration), self.keys[1:-1, self.free].ravel()])

    def with_genes(self, genes: Array, robot: Robot) -> Keyframes:
        """Make the keyframes that :attr:`genes` of another vector describe."""
        count = len(self.duration)
        keys = self.keys.copy()
        values = genes[count:].reshape(len(keys) - 2, len(self.free))
        keys[1:-1, self.free] = values
        paired, partner = self.free[self.mirrored], robot.mirror_index[self.free[self.mirrored]]
        keys[1:-1, partner] = values[:, self.mirrored] * robot.mirror_sign[paired]
        duration = np.exp(np.clip(genes[:count], math.log(0.08), math.log(2.0)))
        return replace(self, duration=duration, keys=np.clip(keys, robot.lower, robot.upper))


def load_keyframes(path: Path, robot: Robot) -> list[Keyframes]:
    """Load authored key postures from a TOML file.

    Each motion has ``keys``: a list of tables with ``after`` (seconds since the key
    before) and the angles [deg] that change there, under ``both`` (left joints,
    mirrored to the right), ``left`` or ``right`` (in the left joint's sense) by joint name
    without its side, or ``middle`` by full name. The standing posture follows as last key.
    """
    table = tomllib.loads(path.read_text("utf-8"))
    return [_read_motion(row, robot) for row in table["motions"]]


def _read_motion(row: dict[str, Any], robot: Robot) -> Keyframes:
    names = robot.joint_names
    posture, keys, after = np.zeros(robot.n), [], []
    one_sided: set[int] = set()
    used: set[int] = set()
    for key in row["keys"]:
        posture = posture.copy()
        for side in ("both", "left", "right", "middle"):
            for joint, degrees in key.get(side, {}).items():
                prefix = {"both": "l_", "left": "l_", "right": "r_", "middle": ""}[side]
                index = names.index(prefix + joint)
                sense = robot.mirror_sign[index] if side == "right" else 1.0
                posture[index] = sense * math.radians(degrees)
                used.add(index)
                if side == "both":
                    partner = int(robot.mirror_index[index])
                    posture[partner] = robot.mirror_sign[index] * posture[index]
                else:
                    one_sided.add(index)
        keys.append(posture)
        after.append(float(key.get("after", 0.0)))
    keys.append(robot.standing.joint_pos)
    asymmetric = any(names[i][:2] in ("l_", "r_") for i in one_sided)
    free = sorted(used | {int(robot.mirror_index[i]) for i in used} if asymmetric else used)
    paired = [not asymmetric and int(robot.mirror_index[i]) != i for i in free]
    return Keyframes(
        name=row["name"],
        start_class=row["start"],
        strategy=row["strategy"],
        duration=np.array([*after[1:], float(row["stand_after"])]),
        keys=np.array(keys),
        free=np.array(free),
        mirrored=np.array(paired),
        torque_limit=float(row["torque_limit"]),
        time_cost=float(row.get("time", 0.5)),
        torque_cost=float(row.get("torque", 1.0)),
    )
