"""Plans that cost no search: a robot lies where a stored motion begins, and plays that."""

import numpy as np

from humanoid_getup.experiments.starts.falls import settle_posture
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cache.cached_rise import fit
from humanoid_getup.strategies.plan import MotionPlan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.search_record import SearchRecord
from robots import Posture
from robots.kinematics import read_posture

MOTION = "prone_push_up_fast"


def lie_at_start(world: World, motion: str = MOTION) -> Posture:
    """Settle a robot, with torque off, in the first posture of one of its motions."""
    first = find_motion(world.robot, motion).posture(0)
    return read_posture(world.robot, world.model, settle_posture(world, first))


def plan_stored(planner: PlannedRise, start: Posture, _rng: np.random.Generator) -> MotionPlan:
    """Plan the nearest stored motion, fitted to the start; stands in for `PlannedRise.plan`."""
    nearest = planner.database.select(start, 1)[0]
    return MotionPlan(
        status=RiseStatus.STOOD,
        motion=fit(nearest.motion, start, planner.world.robot),
        connection=nearest,
        planned=True,
        stand_time=float(nearest.motion.provenance["stand_time_s"]),
        robust=1.0,
        search=SearchRecord(prefer=planner.prefer, budget=planner.search_budget),
        rollouts=2,
        rounds=1,
    )
