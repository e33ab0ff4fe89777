"""Captured rises: targets with which a simulated robot follows a person's clip and stands."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.experiments.judging.outcome import Outcome, compute_share
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.filtering.sampled_tracking import Branches, SampledTracker
from humanoid_getup.motions.build import NoEntryError, with_entries
from humanoid_getup.motions.course import Course, record_motion
from humanoid_getup.motions.motion import NO_END, STANDING, Motion, hold_last
from humanoid_getup.motions.motion_database import list_motions, load_database
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.retarget_clip import RetargetedClip
from humanoid_getup.motions.target_search import TargetSearch, coarsen
from humanoid_getup.motions.time_alignment import measure_limb_error
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.clip_course import (
    BRIDGE,
    Join,
    bend_hands,
    find_joins,
    follow,
    separate_limbs,
)
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

SAMPLES = 400  # of a pass that looks for a way to follow the clip, undisturbed
PASSES = 8  # of these, at most
BACK = 20  # windows before the loss of a clip, whose offsets the next pass discards
LONG_WINDOW, SHORT_WINDOW = 0.1, 0.06  # s; short ones follow swings, long ones bear more
MORE_SAMPLES, WORLDS = 160, 3  # of a pass in disturbed worlds
MORE_PASSES = 3
JUDGED = 16  # worlds of a check, the first undisturbed
SETTLING = 1.8  # s after a bridge from which the robot should balance over its feet
OWN_END = 0.75  # share of a clip from which it should
ENOUGH = 0.9  # share of the disturbed worlds in which a rise stands that is kept
HOPEFUL = 0.5  # share from which no other end is tried before the targets are varied


@dataclass(frozen=True, kw_only=True, eq=False)
class CapturedRise:
    """A clip followed in physics, and how near it comes to a rise."""

    motion: Motion
    """As it went undisturbed; its end class is "other" if it is not one to keep."""
    joined: str
    """Stored rise by which it ends; "" for the clip's own end."""
    stood: int
    """Disturbed worlds in which it stands, of 16 that the search did not see."""
    overlap: float
    """Greatest depth to which the robot reaches into itself [m]."""
    limb_error: float
    """Mean angle between its limbs and those of the clip, aligned in time [rad]."""
    simulated: float
    """Time simulated for it [s]."""

    def __str__(self) -> str:
        """Describe in one line how near it comes to a rise."""
        end = f", ends as {self.joined}" if self.joined else ""
        return (
            f"in physics it stands in {self.stood} of {JUDGED} disturbed worlds{end}: limbs "
            f"{math.degrees(self.limb_error):.0f}° off the clip's, at most "
            f"{1000.0 * self.overlap:.1f} mm into itself"
        )

    @property
    def share(self) -> float:
        """Return the share of the disturbed worlds in which it stands."""
        return self.stood / JUDGED

    @property
    def is_sound(self) -> bool:
        """Tell whether it stands often enough to be kept as a rise."""
        return self.motion.rises


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """Targets that follow a clip, and how often they stand."""

    target: Array
    """[rad], (T, n)"""
    share: float
    """Of the disturbed worlds of the search; 0 if not undisturbed."""
    progress: float
    joined: str

    @property
    def merit(self) -> float:
        return self.share + self.progress


@dataclass(frozen=True, kw_only=True, eq=False)
class _Task:
    """A clip on a robot that lies as it begins."""

    course: Course
    joins: list[Join]
    lying: Array
    """MuJoCo positions, (nq,)."""
    rng: np.random.Generator

    @property
    def balance_from(self) -> int:
        """Return the frame from which the robot should balance over its feet."""
        return round(OWN_END * len(self.course))


class CapturedRiseMaker:
    """Makes rises of retargeted clips of one robot.

    A clip is tracked by sampling, in some disturbed worlds at once. A clip whose own end does
    not stand ends as the stored rise that comes nearest to it; then targets are varied until they
    stand in disturbed worlds.
    """

    def __init__(
        self,
        world: World,
        *,
        budget: float,
        threads: int = 0,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        """Prepare for a budget of simulated time [s] for each clip."""
        self._world, self._budget = world, budget
        robot = world.robot
        self._known = load_database(robot).rising if list_motions(robot) else ()
        self._threads, self._monitor = threads, monitor or ProgressMonitor()
        self._judge = Experiment(world, threads=threads)
        self._simulated = 0.0

    def make(self, clip: RetargetedClip, seed: int) -> CapturedRise:
        """Make a rise of a retargeted clip; the same seed gives the same rise."""
        world = self._world
        own = clip.motion.provenance["clip"]  # rises that were joined to one of it name it, too
        known = [rise for rise in self._known if rise.provenance.get("clip") != own]
        course = bend_hands(separate_limbs(Course.of(clip.motion), world), world, known)
        start = find_rest(world, course[:1].end)
        lying = place(world.robot, world.model, start)
        rng = np.random.default_rng([seed, 0])
        self._simulated = 0.0
        joins = find_joins(course, known, world.robot)
        task = _Task(course=course, joins=joins, lying=lying, rng=rng)
        found = max(self._follow(task), key=lambda each: each.merit)
        left = self._budget - self._simulated
        if 0.0 < found.share < 1.0 and left > 0.0:
            found = self._vary(found, lying, left, rng)
        return self._record(found, clip, start, seed)

    def _follow(self, task: _Task) -> list[_Found]:
        """Follow the clip at once in disturbed worlds; where that falls, first undisturbed."""
        nothing = np.zeros((0, self._world.robot.n))
        found = self._follow_disturbed(task, nothing, LONG_WINDOW, passes=1)
        if max(each.share for each in found) < HOPEFUL and self._simulated < self._budget:
            around = self._find_way(task)
            found += self._follow_disturbed(task, around, SHORT_WINDOW, passes=MORE_PASSES)
        return found

    def _follow_disturbed(
        self, task: _Task, around: Array, window: float, *, passes: int
    ) -> list[_Found]:
        """Follow the clip to its own end, and to those of stored rises, until one stands."""
        robot, course, start = self._world.robot, task.course, task.balance_from
        tracker = self._make_tracker(self._world, task, WORLDS, MORE_SAMPLES, window)
        own, found = [tracker.start], list[_Found]()
        for _ in range(passes):
            own = tracker.track(course, tracker.start, balance_from=start, around=around)
            found.append(self._try_out(own[-1], task, ""))
            if tracker.has_followed(course, own[-1]) or self._is_spent(tracker):
                break
            around = _improve(around, own[-1], is_whole=False)
        for join in task.joins:
            if found[-1].share >= HOPEFUL or self._is_spent(tracker):
                break
            at = join.frame // tracker.cycles
            if at < len(own):
                over = join.frame + round((BRIDGE + SETTLING) / robot.control_period)
                end = tracker.track(follow(course, join, robot), own[at], balance_from=over)[-1]
                found.append(self._try_out(end, task, join.rise.name))
        self._simulated += tracker.simulated
        return found

    def _find_way(self, task: _Task) -> Array:
        """Find offsets with which a robot follows a clip undisturbed, pass by pass, (W, n).

        Each pass samples about what the one before found until shortly before it lost the clip.
        """
        course, around = task.course, np.zeros((0, self._world.robot.n))
        for world in dict.fromkeys([coarsen(self._world), self._world]):
            if self._simulated >= self._budget:
                break
            tracker = self._make_tracker(world, task, 1, SAMPLES, SHORT_WINDOW)
            for _ in range(PASSES):
                end = tracker.track(
                    course, tracker.start, balance_from=task.balance_from, around=around
                )[-1]
                is_whole = tracker.has_followed(course, end)
                around = _improve(around, end, is_whole=is_whole)
                if is_whole or self._is_spent(tracker):
                    break
            self._simulated += tracker.simulated
        return around

    def _make_tracker(
        self, world: World, task: _Task, worlds: int, samples: int, window: float
    ) -> SampledTracker:
        scenarios = CHECK_DISTURBANCE.sample(world, task.lying, worlds, task.rng)
        before = self._simulated

        def goes_on(simulated: float) -> bool:
            done, total = before + simulated, self._budget
            phase = "following the clip [s simulated]"
            self._monitor.show(Progress(phase=phase, done=done, total=max(total, done)))
            return done < total

        return SampledTracker(
            world,
            scenarios,
            samples=samples,
            window=window,
            rng=task.rng,
            threads=self._threads,
            goes_on=goes_on,
        )

    def _is_spent(self, tracker: SampledTracker) -> bool:
        return self._simulated + tracker.simulated >= self._budget

    def _try_out(self, branches: Branches, task: _Task, joined: str) -> _Found:
        """Play the targets of tracked states as motions, and take the best."""
        nominal = Scenarios.nominal(self._world, task.lying)
        outcome = self._judge.compare(nominal, list(branches.sent))
        self._simulated += outcome.record.duration
        merit = (outcome.stood + outcome.progress)[:, 0]
        best = int(np.argmax(merit))
        target, share = branches.sent[best], 0.0
        if outcome.stood[best, 0]:
            checks = CHECK_DISTURBANCE.sample(self._world, task.lying, JUDGED, task.rng)
            checked = self._judge.compare(checks, [target])
            self._simulated += checked.record.duration
            share = compute_share(checked.stood[0])
        progress = float(outcome.progress[best, 0])
        return _Found(target=target, share=share, progress=progress, joined=joined)

    def _vary(self, found: _Found, lying: Array, budget: float, rng: np.random.Generator) -> _Found:
        """Vary targets until they stand in all worlds of a round that they have not seen."""
        preference = Preference.of("time")
        search = TargetSearch(
            self._world, preference=preference, threads=self._threads, monitor=self._monitor
        )
        while budget > 0.0:
            worlds = CHECK_DISTURBANCE.sample(self._world, lying, JUDGED, rng)
            varied = search.search(worlds, found.target, budget, rng)
            budget -= varied.simulated
            self._simulated += varied.simulated
            is_first_try = varied.generations == 0
            found = replace(found, target=varied.target, share=varied.share)
            if varied.share < 1.0 or is_first_try:
                break
        return found

    def _record(
        self, found: _Found, clip: RetargetedClip, start: Posture, seed: int
    ) -> CapturedRise:
        """Judge targets in worlds of their own, and record them as a motion with its entries."""
        world, robot = self._world, self._world.robot
        lying = place(robot, world.model, start)
        rng = np.random.default_rng([seed, 1])
        checks = CHECK_DISTURBANCE.sample(world, lying, 1 + JUDGED, rng)
        stood = self._judge.compare(checks, [found.target]).stood[0, 1:]
        length = len(found.target) + round(HOLD / robot.control_period)
        targets = hold_last(found.target, length)
        outcome = Outcome(
            self._judge.play(Scenarios.nominal(world, lying), targets[None]), robot
        ).take(0)
        is_kept = bool(outcome.stood) and stood.mean() >= ENOUGH
        motion = record_motion(
            world,
            start,
            found.target,
            outcome.record.qpos,
            name=clip.motion.name,
            start_class=clip.motion.start_class,
            end_class=STANDING if is_kept else NO_END,
            strategy=clip.motion.strategy,
            provenance=clip.motion.provenance
            | {"seed": seed, "disturbed_success": float(stood.mean()), "joined": found.joined}
            | ({"stand_time_s": float(outcome.stand_time)} if is_kept else {}),
        )
        if is_kept:
            self._monitor.begin("finding where the motion can be entered")
            with suppress(NoEntryError):  # at its start it can be entered in any case
                motion = with_entries(world, motion)
        return CapturedRise(
            motion=motion,
            joined=found.joined,
            stood=int(stood.sum()),
            overlap=max(float(np.asarray(outcome.overlap)), 0.0),
            limb_error=measure_limb_error(motion, clip, robot),
            simulated=self._simulated,
        )


def _improve(around: Array, end: Branches, *, is_whole: bool) -> Array:
    """Replace offsets (W, n) by those of a pass, until shortly before it lost the clip."""
    found = end.best_offsets
    kept = len(found) if is_whole else max(len(found) - BACK, 0)
    return np.concatenate([found[:kept], around[kept:]])
