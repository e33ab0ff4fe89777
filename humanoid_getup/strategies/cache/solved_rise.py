"""A solved rise: start, conditions, and robustness of the plan."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from humanoid_getup.motions.motion import MAX_DURATION, StartClass
from humanoid_getup.motions.preference import PreferenceName
from robots import Posture, TorqueLimit
from robots.posture import UNIT_TOLERANCE
from robots.quaternion import Array
from robots.servo import LimitMode
from robots.storage.validation import on_axes, positive, read_table, whole

MOST_TORQUE, MOST_FRAMES = 1000.0, 10**6
MOST_TIME = 1e11  # s since 1970


@dataclass(frozen=True, kw_only=True)
class PlanContext:
    """Inputs of a plan besides the start."""

    robot: str
    scene: str
    fingerprint: str
    """Checksum of robot, scene, motions, program and settings."""
    limit_by: LimitMode
    torque_limit: Annotated[float, positive(MOST_TORQUE, "N·m")] | None = None
    """Torque limit of every servo [N·m]; None for stall torque."""
    prefer: PreferenceName = "time"
    """What the rise should be besides successful."""

    @property
    def limit(self) -> TorqueLimit:
        """Return the torque limit with its mode."""
        return TorqueLimit(self.torque_limit, self.limit_by)


@dataclass(frozen=True, kw_only=True, eq=False)
class SolvedRise:
    """A start, and the solution of its rise; the motion has a file of its own."""

    context: PlanContext
    start_class: StartClass
    position: Annotated[Array, on_axes(1)]
    """Of the root at the start [m], (3,)."""
    orientation: Annotated[Array, on_axes(1)]
    """Of the root at the start, unit quaternion w x y z, (4,)."""
    joint_pos: Annotated[Array, on_axes(1)]
    """Joint angles at the start [rad], (n,), in the robot's joint order."""
    connection: str
    """Name of the stored motion that the rise joins."""
    frame: Annotated[int, whole(0, MOST_FRAMES)]
    """Frame at which it joins."""
    distance: Annotated[float, Meta(ge=0.0, description="a finite number, 0 or more")]
    """Posture metric from the start to that frame."""
    planned: bool
    stand_time: Annotated[float, positive(MAX_DURATION, "s")]
    """Start to held stand in the rollout [s]."""
    robust: Annotated[float, Meta(ge=0.0, le=1.0, description="a share from 0 to 1")]
    """Share of the disturbed rollouts that stood."""
    made: Annotated[float, Meta(ge=0.0, le=MOST_TIME, description="a time in s since 1970")]
    """When it was solved [s since 1970]."""

    @property
    def name(self) -> str:
        """Return the name of its files: the same start and context have the same name."""
        digest = hashlib.sha256(repr(self.context).encode())
        for array in (self.position, self.orientation, self.joint_pos):
            digest.update(np.ascontiguousarray(array, dtype=float).tobytes())
        return digest.hexdigest()[:16]

    @property
    def start(self) -> Posture:
        """Return where the robot lay."""
        return Posture(
            position=self.position, orientation=self.orientation, joint_pos=self.joint_pos
        )


def read_solved_rise(record: dict[str, Any]) -> SolvedRise:
    """Read a solved rise from the content of JSON.

    Raises:
        ValueError: naming everything that is wrong.
    """
    problems: list[str] = []
    rise = read_table(SolvedRise, record, "", problems)
    if problems := problems or _find_problems(rise):
        raise ValueError("; ".join(problems))
    return rise


def _find_problems(rise: SolvedRise) -> list[str]:
    if rise.position.shape != (3,) or rise.orientation.shape != (4,):
        shapes = f"{rise.position.shape} and {rise.orientation.shape}"
        return [f"position and orientation have shapes {shapes}, expected (3,) and (4,)"]
    length = float(np.linalg.norm(rise.orientation))
    if abs(length - 1.0) > UNIT_TOLERANCE:
        return [f"orientation has length {length:.4f}, expected 1"]
    return []
