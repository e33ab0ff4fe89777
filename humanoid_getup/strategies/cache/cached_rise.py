"""A strategy that reuses the plan of the nearest solved rise if it still stands."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from importlib.metadata import version

import mujoco
import numpy as np

from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import FOUND, Motion
from humanoid_getup.motions.motion_database import Connection
from humanoid_getup.motions.posture_metric import best_yaw, measure_tilt
from humanoid_getup.strategies.cache.plan_cache import (
    CacheEntry,
    PlanCache,
    PlanCacheError,
    now,
)
from humanoid_getup.strategies.cache.solved_rise import PlanContext, SolvedRise
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, RiseStatus
from humanoid_getup.strategies.plan_figures import CacheFigures, PlanFigures
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.search_record import SearchRecord
from robots import Posture, Robot, quaternion
from robots.quaternion import Array
from robots.smooth_step import smooth_step

SAME_ANGLE = 0.001  # rad; less than a tick of an encoder
MOST_DISTANCE = 0.5  # posture metric; a little more than 5 degrees in every joint
NEAR_CHECKS = 4  # rollouts of a plan for a near start, the first one undisturbed
FADE = 0.5  # s in which the difference between two starts fades out of the joint angles


@dataclass(frozen=True, kw_only=True)
class Nearness:
    """Distance of a start from that of a solved rise."""

    distance: float
    """Posture metric."""
    joint: float
    """Largest difference of a joint angle [rad]."""
    tilt: float
    """Angle between the directions of gravity in the two root frames [rad]."""

    @property
    def is_same(self) -> bool:
        """Return whether the starts differ by less than encoders resolve."""
        return max(self.joint, self.tilt) < SAME_ANGLE


@dataclass(frozen=True, kw_only=True)
class KeptPlan(MotionPlan):
    """A motion plan that is in the cache, taken from it or added to it."""

    cache: PlanCache
    entry: CacheEntry
    nearness: Nearness | None = None
    """Distance of the start from that of the entry; ``None`` if planned for this start."""

    def forget(self) -> None:
        """Remove the plan from the cache."""
        self.cache.remove(self.entry)

    def figures(self) -> PlanFigures:
        """Return the figures of the plan."""
        near = self.nearness
        reused = near and CacheFigures(
            entry=self.entry.name,
            age_s=now() - self.entry.rise.made,
            distance=near.distance,
            joint_rad=near.joint,
            tilt_rad=near.tilt,
        )
        return replace(super().figures(), plan_cache=reused)


class CachedRise:
    """Plans rises, stores solved ones, and tries the nearest stored one first.

    The plan of a start so near that the disturbed rollouts of the check covered it is fitted to
    the measured start and rolled out again: undisturbed, and disturbed unless the start is the
    same. It is used if it ends standing every time; otherwise the rise is planned as without a
    cache. A plan serves only under the torque limit for which it was solved, and only the robot,
    scene, motions and program with which it was.
    """

    def __init__(
        self,
        planner: PlannedRise,
        cache: PlanCache,
        *,
        report: Callable[[str], None] = lambda _problem: None,
    ) -> None:
        """Plan with a cache.

        Args:
            planner: Plans what the cache does not know.
            cache: Where solved rises are kept.
            report: Called with one line for each damaged entry, and for a rise that cannot be
                kept; neither stops a rise.
        """
        self.world, self.torque_limit = planner.world, planner.torque_limit
        self._planner, self._cache, self._report = planner, cache, report
        self._reported: set[str] = set()
        self.context = PlanContext(
            robot=self.world.robot.name,
            scene=self.world.scene.name,
            fingerprint=compute_fingerprint(planner),
            torque_limit=self.torque_limit.value,
            limit_by=self.torque_limit.mode,
            prefer=planner.prefer,
        )

    def plan(self, start: Posture, rng: np.random.Generator) -> RisePlan:
        """Plan a rise from a posture at rest.

        Without a usable plan in the cache, it is the planner's own for the same arguments. Plans
        through key postures are neither looked for nor kept.
        """
        if self._planner.keys:
            return self._planner.plan(start, rng)
        began = time.perf_counter()
        if (near := self._find_nearest(start)) is not None:
            # A generator of its own, so that a plan that fails does not change the next one.
            reused = self._reuse(*near, start, rng.spawn(1)[0], began)
            if reused is not None:
                return reused
        return self._keep(start, self._planner.plan(start, rng))

    def _find_nearest(self, start: Posture) -> tuple[CacheEntry, Nearness] | None:
        """Find the solved rise with the start nearest to a given one, if it is near enough."""
        try:
            content = self._cache.read(self.context.robot)
        except OSError as error:
            self._warn(f"plan cache {error.filename}: {error.strerror}")
            return None
        for problem in content.problems:
            self._warn(f"{problem}; the entry is ignored")
        measured = [
            (entry, self._measure(start, entry.rise.start))
            for entry in content.entries
            if entry.rise.context == self.context
            and len(entry.rise.joint_pos) == len(start.joint_pos)
        ]
        usable = [pair for pair in measured if self._is_usable(*pair, start)]
        return min(usable, key=lambda pair: pair[1].distance, default=None)

    def _measure(self, a: Posture, b: Posture) -> Nearness:
        tilt = measure_tilt(a.orientation, b.orientation)
        return Nearness(
            distance=self._planner.database.metric.between(a, b),
            joint=float(np.abs(a.joint_pos - b.joint_pos).max()),
            tilt=float(tilt),
        )

    def _is_usable(self, entry: CacheEntry, near: Nearness, start: Posture) -> bool:
        """Return whether a rise may be reused for a start."""
        if not self.world.scene.is_flat:  # there, place and heading matter as well
            shift = np.abs(start.position - entry.rise.position).max()
            turn = quaternion.angle_between(start.orientation, entry.rise.orientation)
            return near.is_same and max(float(shift), float(turn)) < SAME_ANGLE
        return near.is_same or (near.distance <= MOST_DISTANCE and entry.rise.robust == 1.0)

    def _reuse(
        self,
        entry: CacheEntry,
        near: Nearness,
        start: Posture,
        rng: np.random.Generator,
        began: float,
    ) -> KeptPlan | None:
        """Fit a stored motion to a start, and return its plan if it stands there."""
        rise, planner = entry.rise, self._planner
        try:
            motion = fit(entry.load_motion(), start, self.world.robot)
        except PlanCacheError as error:
            self._warn(f"{error}; the entry is ignored")
            return None
        known = {m.name: m for m in planner.database.rising}
        if rise.connection == FOUND:  # for this rise alone, and not stored
            known[FOUND] = replace(motion, name=FOUND)
        if (joined := known.get(rise.connection)) is None:
            return None
        plan_s = time.perf_counter() - began
        began = time.perf_counter()
        checks = 1 if near.is_same else NEAR_CHECKS
        if planner.filter.check(start, motion.joint_target, rng, checks) < 1.0:
            return None
        return KeptPlan(
            status=RiseStatus.STOOD,
            motion=motion,
            connection=Connection(joined, rise.frame, rise.distance),
            planned=rise.planned,
            stand_time=rise.stand_time,
            robust=rise.robust,
            search=SearchRecord(prefer=planner.prefer, budget=planner.search_budget),
            rollouts=checks,
            plan_s=plan_s,
            filter_s=time.perf_counter() - began,
            cache=self._cache,
            entry=entry,
            nearness=near,
        )

    def _keep(self, start: Posture, plan: RisePlan) -> RisePlan:
        """Store a plan that stands in the cache."""
        joined = plan.connection
        if not isinstance(plan, MotionPlan) or plan.status is not RiseStatus.STOOD or not joined:
            return plan
        rise = SolvedRise(
            context=self.context,
            start_class=plan.motion.start_class,
            position=start.position,
            orientation=start.orientation,
            joint_pos=start.joint_pos,
            connection=joined.motion.name,
            frame=joined.frame,
            distance=joined.distance,
            planned=plan.planned,
            stand_time=plan.stand_time,
            robust=plan.robust,
            made=now(),
        )
        try:
            entry = self._cache.keep(rise, plan.motion)
        except OSError as error:
            self._warn(f"plan cache {error.filename}: {error.strerror}; the plan is not kept")
            return plan
        known = {field.name: getattr(plan, field.name) for field in fields(MotionPlan)}
        return KeptPlan(**known, cache=self._cache, entry=entry)

    def _warn(self, problem: str) -> None:
        if problem not in self._reported:
            self._reported.add(problem)
            self._report(problem)


def fit(motion: Motion, start: Posture, robot: Robot) -> Motion:
    """Turn and shift a motion over the ground to a near start; it begins at the start's angles.

    The targets stay as they were checked from disturbed starts, but for the first few, which must
    not be beyond the reach of the servos. Shifted by the difference between the starts, they fell
    where a limb has little room. A motion that begins at the start already stays as it is.
    """
    apart = start.joint_pos - motion.joint_pos[0]
    yaw = best_yaw(motion.orientation[0], start.orientation)
    shift = start.position - motion.position[0]
    if max(np.abs(apart).max(), abs(float(yaw)), np.abs(shift).max()) < SAME_ANGLE:
        return motion
    aligned = Course.aligned(motion, 0, start, keep_height=False)
    angles = motion.joint_pos + _fade(motion.time - motion.time[0])[:, None] * apart
    return replace(
        motion,
        position=aligned.position,
        orientation=quaternion.normalize(aligned.orientation),
        joint_pos=np.clip(angles, robot.lower, robot.upper),
        joint_target=robot.limit_targets(motion.joint_target, start.joint_pos),
    )


def _fade(time: Array) -> Array:
    """Return the remaining share of the difference at times [s], smoothly from 1 to 0."""
    return 1.0 - smooth_step(time / FADE)


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
