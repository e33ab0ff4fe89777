"""Keyframes: motions as hand-written key postures, before any physics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta
from scipy.interpolate import PchipInterpolator

from humanoid_getup.motions.motion import STANDING, EndClass, StartClass, hold_last
from robots import Robot
from robots.quaternion import Array
from robots.validation import load_toml, name_unknown_joints, positive, read_table

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
    """The strategy in biomechanics' terms."""
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
        duration, limit = self.duration.copy(), SPEED_SHARE * robot.max_velocity
        for _ in range(4):
            knots = np.concatenate([[0.0], np.cumsum(duration)])
            curve = PchipInterpolator(knots, self.keys, axis=0)
            time = np.arange(0.0, knots[-1] + robot.control_period, robot.control_period)
            time = np.minimum(time, knots[-1])
            excess = np.max(np.abs(curve(time, 1)) / limit, axis=1)
            segment = np.minimum(np.searchsorted(knots, time, side="right") - 1, len(duration) - 1)
            stretch = np.zeros(len(duration))
            np.maximum.at(stretch, segment, excess)
            if np.all(stretch <= 1.0):
                break
            duration = duration * np.maximum(1.0, stretch)
        moving = np.clip(curve(time), robot.lower, robot.upper)
        return hold_last(moving, len(moving) + round(hold / robot.control_period))

    @property
    def genes(self) -> Array:
        """Return what the optimization may change in a vector: log times, then angles [rad]."""
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


class KeyframesError(ValueError):
    """A file does not hold keyframes for the robot; the message names all that is wrong."""


Degrees = dict[str, Annotated[float, Meta(description="a finite angle in degrees")]]
SIDES = {"both": "l_", "left": "l_", "right": "r_", "middle": ""}
"""Prefixes of the joint names that a key gives per side."""


@dataclass(frozen=True, kw_only=True)
class _Key:
    """One key posture of a file."""

    after: Annotated[float, Meta(ge=0.0, description="0 s or more")] = 0.0
    both: Degrees = field(default_factory=dict)
    left: Degrees = field(default_factory=dict)
    right: Degrees = field(default_factory=dict)
    middle: Degrees = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Row:
    """One table [[motions]] of a file."""

    name: str
    start: StartClass
    strategy: str
    torque_limit: Annotated[float, positive(1000.0, "N·m")]
    keys: tuple[_Key, ...]
    end: EndClass = STANDING
    stand_after: Annotated[float, positive(60.0, "s")] | None = None
    time: Annotated[float, Meta(ge=0.0, description="0 or more")] = 0.5
    torque: Annotated[float, Meta(ge=0.0, description="0 or more")] = 1.0


@dataclass(frozen=True, kw_only=True)
class _File:
    motions: tuple[_Row, ...]


def load_keyframes(path: Path, robot: Robot) -> list[Keyframes]:
    """Load key postures from a TOML file.

    Each motion has ``keys``: a list of tables with ``after`` (seconds since the key
    before) and the angles [deg] that change there, under ``both`` (left joints,
    mirrored to the right), ``left`` or ``right`` (in the left joint's sense) by joint name
    without its side, or ``middle`` by full name. The standing posture follows as last key,
    ``stand_after`` seconds later, unless the motion's ``end`` is a side to lie on.

    Raises:
        KeyframesError: naming all that is wrong with the file.
    """
    problems: list[str] = []
    try:
        file = read_table(_File, load_toml(path), "", problems)
    except ValueError as error:
        raise KeyframesError(f"{path}: {error}") from error
    names = [
        prefix + name
        for row in file.motions
        for key in row.keys
        for side, prefix in SIDES.items()
        for name in getattr(key, side)
    ]
    unknown = [name for name in dict.fromkeys(names) if name not in robot.joint_names]
    problems += name_unknown_joints(unknown, robot.joint_names)
    problems += [text for row in file.motions for text in _find_end_problems(row)]
    if problems:
        raise KeyframesError(f"{path}: {'; '.join(problems)}")
    return [_build_keyframes(row, robot) for row in file.motions]


def _find_end_problems(row: _Row) -> list[str]:
    if row.end == STANDING and row.stand_after is None:
        return [f"motion '{row.name}': stand_after is missing, expected the time to the stand [s]"]
    if row.end != STANDING and row.stand_after is not None:
        return [f"motion '{row.name}': stand_after is given, expected none: it ends {row.end}"]
    return []


def _build_keyframes(row: _Row, robot: Robot) -> Keyframes:
    names = robot.joint_names
    standing = robot.standing.joint_pos
    posture, keys = standing if row.start == STANDING else np.zeros(robot.n), []
    one_sided: set[int] = set()
    used: set[int] = set()
    for key in row.keys:
        posture = posture.copy()
        for side, prefix in SIDES.items():
            for joint, degrees in getattr(key, side).items():
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
    duration = [key.after for key in row.keys[1:]]
    if row.stand_after is not None:
        keys.append(standing)
        duration.append(row.stand_after)
    asymmetric = any(names[i][:2] in ("l_", "r_") for i in one_sided)
    free = sorted(used | {int(robot.mirror_index[i]) for i in used} if asymmetric else used)
    paired = [not asymmetric and int(robot.mirror_index[i]) != i for i in free]
    return Keyframes(
        name=row.name,
        start_class=row.start,
        end_class=row.end,
        strategy=row.strategy,
        duration=np.array(duration),
        keys=np.array(keys),
        free=np.array(free),
        mirrored=np.array(paired),
        torque_limit=row.torque_limit,
        time_cost=row.time,
        torque_cost=row.torque,
    )
