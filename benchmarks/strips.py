"""Rises to be drawn, one for each row of a picture."""

from __future__ import annotations

import numpy as np

import humanoid_getup as hg
from humanoid_getup.reporting import film_strip
from robots.quaternion import Array

FALLS = 5  # that may be tried for a row, with consecutive seeds


def get_up(world: hg.World, start: str, seed: int, name: str) -> Array | None:
    """Return the states (T, nq) of a rise, from the first fall from which the robot stands."""
    for number in range(seed, seed + FALLS):
        fall = hg.sample_fall(world, start, number)
        with hg.Twin(world, fall.posture) as twin:
            result = hg.get_up(twin, hg.PlannedRise(world), seed=number, max_attempts=1)
        print(f"{name}, seed {number}: {result}", flush=True)
        if result.stood and result.outcome is not None:
            end = float(result.outcome.stand_time) + film_strip.AFTERMATH
            rise = result.outcome.qpos[: round(end / world.robot.control_period)]
            return np.concatenate([*(move.outcome.qpos for move in result.moves), rise])
    return None
