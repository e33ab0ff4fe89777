"""Plans that cost no search: a robot lies where a stored motion begins, and plays that."""

from dataclasses import replace

import numpy as np

from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, quaternion
from robots.kinematics import read_posture
from robots.smooth_step import smooth_step

MOTION = "prone_push_up_fast"
FADE = 0.5  # s in which the difference between two starts fades out of the joint angles


def lie_at_start(world: World, motion: str = MOTION) -> Posture:
    """Settle a robot, with torque off, in the first posture of one of its motions."""
    first = find_motion(world.robot, motion).posture(0)
    return read_posture(world.robot, world.model, settle_posture(world, first))


def plan_stored(planner: PlannedRise, start: Posture, _rng: np.random.Generator) -> Plan:
    """Plan the nearest stored motion, fitted to the start; stands in for `PlannedRise.plan`."""
    nearest = planner.database.select(start, 1)[0]
    return Plan(
        status=RiseStatus.STOOD,
        motion=fit(nearest.motion, start, planner.world.robot),
        connection=nearest,
        planned=True,
        robust=1.0,
        settings=planner.settings,
        rollouts=2,
        rounds=1,
    )


def fit(motion: Motion, start: Posture, robot: Robot) -> Motion:
    """Turn and shift a motion over the ground to a near start; it begins at the start's angles."""
    apart = start.joint_pos - motion.joint_pos[0]
    aligned = Course.aligned(motion, 0, start, keep_height=False)
    remains = 1.0 - smooth_step((motion.time - motion.time[0]) / FADE)
    return replace(
        motion,
        position=aligned.position,
        orientation=quaternion.normalize(aligned.orientation),
        joint_pos=np.clip(motion.joint_pos + remains[:, None] * apart, robot.lower, robot.upper),
        joint_target=robot.limit_targets(motion.joint_target, start.joint_pos),
    )
