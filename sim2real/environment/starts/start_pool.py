"""Pools of initial states; hard ones are drawn more often."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots import Robot
from robots.quaternion import Array
from robots.storage.arrays import ArchiveError, check_robot, load_arrays, save_arrays, to_numbers

# Weight of the last episode in the success rate of an initial state: the last three episodes
# dominate, since older ones are of an earlier policy.
MEMORY = 0.3
# Weight of an initial state that always ends standing, relative to one that never does: low
# enough to leave time for hard ones, high enough that it is not forgotten.
LEAST = 0.15


@dataclass(eq=False)
class StartPool:
    """Initial states with their success rates; those that fail are drawn more often."""

    qpos: Array
    """MuJoCo positions, (P, nq)."""
    success: Array
    """Running fraction of episodes that ended standing, (P,)."""
    level: NDArray[np.int_]
    """How difficult each state is, 0 for the easiest, such as flat ground, (P,)."""
    fallen: NDArray[np.bool_]
    """Whether each state is a settled fall; the others are frames of motions, (P,)."""

    @staticmethod
    def of(
        qpos: Array, level: NDArray[np.int_] | None = None, fallen: NDArray[np.bool_] | None = None
    ) -> StartPool:
        """Make a pool whose success rates are 0; by default all states are falls of level 0."""
        count = len(qpos)
        return StartPool(
            qpos,
            np.zeros(count),
            np.zeros(count, dtype=int) if level is None else level,
            np.ones(count, dtype=bool) if fallen is None else fallen,
        )

    def draw(self, count: int, rng: np.random.Generator, highest: int = 0) -> NDArray[np.int_]:
        """Draw rows of the pool, as often from each level up to the highest, hard ones more often.

        Otherwise most episodes would begin on the level where no robot rises yet.
        """
        weight = LEAST + (1.0 - LEAST) * (1.0 - self.success)
        if self.level.any():
            weight = weight / np.bincount(self.level, weight)[self.level]
        weight = np.where(self.level <= highest, weight, 0.0)
        total = np.cumsum(weight)
        return np.searchsorted(total, rng.uniform(0.0, total[-1], count))

    def note(self, starts: NDArray[np.int_], stood: NDArray[np.bool_]) -> None:
        """Update the success rates by some episodes."""
        self.success[starts] += MEMORY * (stood - self.success[starts])

    def save(self, file: Path, robot: Robot) -> None:
        """Write the initial states and the robot's name to an .npz file."""
        arrays = {"qpos": self.qpos, "robot": robot.name}
        arrays |= {"level": self.level} if self.level.any() else {}
        arrays |= {} if self.fallen.all() else {"fallen": self.fallen}
        save_arrays(file, arrays)

    @staticmethod
    def load(file: Path, robot: Robot, width: int) -> StartPool:
        """Read a robot's initial states, of ``width`` MuJoCo positions, from an .npz file."""
        try:
            arrays = load_arrays(file, ("qpos", "robot"), optional=("level", "fallen"))
            check_robot(arrays["robot"], robot.name)
            qpos = to_numbers(arrays["qpos"], "qpos", (None, width))
            level, fallen = arrays.get("level"), arrays.get("fallen")
            if level is not None:
                level = to_numbers(level, "level", (len(qpos),)).astype(int)
            if fallen is not None:
                fallen = to_numbers(fallen, "fallen", (len(qpos),)).astype(bool)
        except (OSError, ArchiveError) as error:
            raise ValueError(
                f"{file} holds no starts, expected an .npz of falls: {error}"
            ) from error
        return StartPool.of(qpos, level, fallen)
