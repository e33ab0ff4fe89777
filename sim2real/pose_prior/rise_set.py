"""Rises from many sources: postures for the pose prior, curves and initial states for training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.style.curves import StyleCurves, extract_curves, measure_features
from robots import Robot
from robots.quaternion import Array
from robots.storage.arrays import (
    ArchiveError,
    check_robot,
    load_arrays,
    save_arrays,
    to_numbers,
    to_text,
)

POLICY_SOURCE = "policy: "  # begins the source of a rise by a policy, before its name
PERIOD = 0.048  # s between two frames of a rise


@dataclass(frozen=True, kw_only=True)
class CollectedRise:
    """One rise on flat ground: MuJoCo positions every `PERIOD`, from lying to standing."""

    source: str
    """Its source, such as "planned: sit-up" or "policy: robust"."""
    qpos: Array
    """(T, nq)"""
    joint_target: Array
    """Targets that were sent to the servos [rad], (T, n)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RiseSet:
    """Many rises of one robot, their frames one after another."""

    robot: Robot
    qpos: Array
    """MuJoCo positions on flat ground, of the robot alone, (F, nq)."""
    joint_target: Array
    """Targets of the servos at all frames [rad], (F, n)."""
    first: NDArray[np.int_]
    """Row of each rise's first frame, and the number of frames, (R + 1,)."""
    sources: tuple[str, ...]
    """Source of each rise, (R,)."""

    def __len__(self) -> int:
        return len(self.sources)

    @staticmethod
    def join(robot: Robot, rises: Sequence[CollectedRise]) -> RiseSet:
        """Join rises of a robot."""
        return RiseSet(
            robot=robot,
            qpos=np.concatenate([rise.qpos for rise in rises]),
            joint_target=np.concatenate([rise.joint_target for rise in rises]),
            first=np.cumsum([0, *(len(rise.qpos) for rise in rises)]),
            sources=tuple(rise.source for rise in rises),
        )

    @property
    def model(self) -> mujoco.MjModel:
        """Return the model whose positions the frames are: the robot alone."""
        return self.robot.spec().compile()

    @property
    def joint_pos(self) -> Array:
        """Return the joint angles of all frames [rad], (F, n)."""
        return self.qpos[:, self.robot.layout(self.model).qpos]

    @cached_property
    def features(self) -> Array:
        """Return the style features of all frames, (F, 3)."""
        return measure_features(self.robot, self.model, self.qpos)

    def duration(self, rise: int) -> float:
        """Return how long a rise lasts [s]."""
        return float((self.first[rise + 1] - self.first[rise] - 1) * PERIOD)

    def curves(self, rise: int) -> StyleCurves:
        """Extract the style curves of a rise."""
        features = self.features[self.first[rise] : self.first[rise + 1]]
        return extract_curves(np.arange(len(features), dtype=float) * PERIOD, features)

    def save(self, file: Path) -> None:
        """Write the rises to an .npz file."""
        arrays = {
            "qpos": self.qpos.astype(np.float32),
            "joint_target": self.joint_target.astype(np.float32),
            "first": self.first,
        }
        save_arrays(file, arrays | {"sources": "\n".join(self.sources), "robot": self.robot.name})

    @staticmethod
    def load(file: Path, robot: Robot) -> RiseSet:
        """Read the rises of a robot; raises ValueError if the file holds none of it."""
        width = robot.spec().compile().nq
        try:
            arrays = load_arrays(file, ("qpos", "joint_target", "first", "sources", "robot"))
            check_robot(arrays["robot"], robot.name)
            sources = tuple(to_text(arrays["sources"], "sources").split("\n"))
            qpos = to_numbers(arrays["qpos"], "qpos", (None, width))
            target = to_numbers(arrays["joint_target"], "joint_target", (len(qpos), robot.n))
            first = to_numbers(arrays["first"], "first", (len(sources) + 1,)).astype(int)
            if first[0] != 0 or first[-1] != len(qpos) or np.any(np.diff(first) < 2):
                raise ArchiveError("first does not divide the frames into rises")
        except ArchiveError as error:
            raise ValueError(f"{file} holds no rises, expected an .npz of them: {error}") from error
        return RiseSet(robot=robot, qpos=qpos, joint_target=target, first=first, sources=sources)
