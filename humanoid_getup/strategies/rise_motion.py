"""Motions of a planned rise, made from a rollout, or from a path and a stored motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanoid_getup.experiments.starts.falls import classify, find_side
from humanoid_getup.filtering.candidate import CandidateRollout
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import NO_END, Motion, Trajectory
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.motion_record import record_motion
from humanoid_getup.motions.retargeting import name_body
from humanoid_getup.simulation.world import World
from robots import Posture

if TYPE_CHECKING:
    from humanoid_getup.posture_chains.crawl_search import Crawl


def make_motion(world: World, start: Posture, rollout: CandidateRollout) -> Motion:
    """Make a motion of the postures and the targets of a rollout."""
    joined = rollout.candidate.connection.motion
    return record_motion(
        world,
        start,
        rollout.target[: rollout.moving],
        rollout.qpos,
        name=f"rise_by_{joined.name}",
        start_class=classify(start.orientation) or joined.start_class,
        strategy=joined.strategy,
        provenance={"program": "getup rise", "connection": joined.name} | name_body(world.robot),
    )


def make_crawl(world: World, start: Posture, crawl: Crawl) -> Motion:
    """Make a motion of a crawl, which does not end standing."""
    return record_motion(
        world,
        start,
        crawl.target,
        crawl.qpos,
        name="crawl",
        start_class=find_side(start),
        end_class=NO_END,
        strategy="crawl",
        provenance={"program": "getup rise"} | name_body(world.robot),
    )


def chain(world: World, path: Trajectory, connection: Connection) -> Motion:
    """Chain a path's angles and the motion's own targets, unchanged.

    The motion is turned and moved to the end of the path.
    """
    joined, frame, count = connection.motion, connection.frame, len(path.time)
    aligned = Course.aligned(joined, frame, path.posture(-1), keep_height=False)
    return (
        Course.of(path)
        .then(aligned[frame:])
        .to_motion(
            joined,
            world.robot.control_period,
            name=f"path_to_{joined.name}",
            start_class=classify(path.orientation[0]) or joined.start_class,
            provenance={"program": "getup rise", "connection": joined.name, "path_frames": count}
            | name_body(world.robot),
        )
    )
