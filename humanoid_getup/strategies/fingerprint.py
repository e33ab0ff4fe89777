"""Fingerprint of the inputs of a plan: a benchmark resumes only where they are the same."""

from __future__ import annotations

import hashlib
from importlib.metadata import version

import mujoco
import numpy as np

from humanoid_getup.strategies.planned_rise import PlannedRise


def compute_fingerprint(planner: PlannedRise) -> str:
    """Compute a checksum of the inputs of a plan, besides start, limit and seed.

    It is that of the compiled model of robot and scene, the robot's description, the motions, the
    settings of the planner, and the versions of this program and of MuJoCo.
    """
    chosen = planner.options
    settings = (chosen.planning, chosen.filtering, chosen.assistance, planner.search_budget)
    digest = hashlib.sha256(
        repr((version("humanoid-getup"), mujoco.__version__, settings)).encode()
    )
    digest.update(planner.world.content)
    for motion in planner.database.motions:
        digest.update(motion.name.encode())
        for array in (
            motion.time,
            motion.position,
            motion.orientation,
            motion.joint_pos,
            motion.joint_target,
        ):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(motion.entry.tobytes())
    return digest.hexdigest()[:32]
