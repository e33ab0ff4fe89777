"""Captured rises: a clip of a person made physical, on a body that is simulated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import mujoco
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
from humanoid_getup.motions.motion_database import MotionDatabase, list_motions, load_database
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.retarget_clip import RetargetedClip
from humanoid_getup.motions.target_search import TargetSearch, coarsen
from humanoid_getup.motions.time_alignment import measure_limb_error
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.body.limbs import ARMS, Limbs
from robots.kinematics import lowest_points, place, place_postures
from robots.quaternion import Array
from robots.smooth_step import smooth_step

SAMPLES = 400  # of a pass that looks for a way to follow the clip, undisturbed
PASSES = 8  # of these, at most
BACK = 20  # windows before the place where a pass lost the clip, from which the next samples anew
LONG_WINDOW, SHORT_WINDOW = 0.1, 0.06  # s; short ones follow swings, long ones bear more
MORE_SAMPLES, WORLDS = 160, 3  # of a pass in disturbed worlds
MORE_PASSES = 3
JUDGED = 16  # disturbed worlds
HAND_NEAR = 0.2, 0.15  # neck heights over the ground: hands are straight, and flat
EASE = 0.3  # s over which a hand turns
JOIN_PERIOD = 0.25  # s of the clip for each place at which a stored rise may be joined
JOIN_FROM = 0.5  # share of the clip before it: with less, it would be no rise of the clip's
BRIDGE = 0.4  # s from the clip to the stored rise
BEFORE_STAND = 0.8  # s before the stand of a stored rise within which it is not joined
SETTLING = 1.8  # s after a bridge from which the robot should balance over its feet
OWN_END = 0.75  # share of a clip from which it should
ENOUGH = 0.9  # share of the disturbed worlds in which a rise stands that is kept
HOPEFUL = 0.5  # share from which no other end is tried before the targets are varied


@dataclass(frozen=True, kw_only=True, eq=False)
class Join:
    """A place of a clip from which a stored rise leads to the stand."""

    frame: int
    """Of the clip."""
    rise: Motion
    entry: int
    """Frame of the rise."""
    distance: float
    """Between the two, in the posture metric."""


def bend_hands(course: Course, world: World, rises: Sequence[Motion]) -> Course:
    """Bend the wrists while a hand is near the ground, as the robot's own rises do.

    Clips know nothing of hands, and a body that leans on its fingertips stands too high.
    """
    robot = world.robot
    limbs = Limbs(robot)
    joint_pos = course.joint_pos.copy()
    for name in ARMS:
        if name not in limbs.all:
            continue
        wrist = [k for k in limbs.all[name].joints if robot.joints[k].segment == "wrist"]
        if not wrist:
            continue
        flat = _find_flat(world, rises, wrist)
        if flat is None:
            continue
        far, near = (share * robot.standing_neck_height for share in HAND_NEAR)
        height = _measure_heights(course, world, wrist[-1])
        share = np.clip((far - height) / (far - near), 0.0, 1.0)
        width = max(round(EASE / robot.control_period), 1)
        padded = np.pad(share, (width // 2, width - 1 - width // 2), mode="edge")
        share = np.convolve(padded, np.full(width, 1.0 / width), "valid")
        joint_pos[:, wrist] = share[:, None] * flat
    bent = replace(course, joint_pos=joint_pos, joint_target=joint_pos)
    qpos = place_postures(robot, world.model, bent.position, bent.orientation, joint_pos)
    position = bent.position.copy()
    position[:, 2] -= lowest_points(world.model, qpos)
    return replace(bent, position=position)


def _measure_heights(course: Course | Motion, world: World, joint: int) -> Array:
    """Measure how high a joint of a robot is [m], (T,)."""
    robot, model = world.robot, world.model
    data, row = mujoco.MjData(model), model.joint(robot.joint_names[joint]).id
    qpos = place_postures(robot, model, course.position, course.orientation, course.joint_pos)
    height = np.zeros(len(qpos))
    for k, one in enumerate(qpos):
        data.qpos[:] = one
        mujoco.mj_kinematics(model, data)
        height[k] = data.xanchor[row, 2]
    return height


def _find_flat(world: World, rises: Sequence[Motion], wrist: list[int]) -> Array | None:
    """Find the wrist angles with which a robot's rises lean on a hand [rad]."""
    if not rises:
        return None
    near = HAND_NEAR[1] * world.robot.standing_neck_height
    rows = [
        rise.joint_target[_measure_heights(rise, world, wrist[-1]) < near][:, wrist]
        for rise in rises
    ]
    angles = np.concatenate(rows)
    return np.median(angles, axis=0) if len(angles) else None


def find_joins(course: Course, database: MotionDatabase, period: float) -> list[Join]:
    """Find where stored rises are nearest to a course: the best in each part of its time."""
    metric = database.metric
    first = round(JOIN_FROM * len(course))
    step = max(round(0.04 / period), 1)
    rows = np.arange(first, len(course), step)
    parts = max(round((len(course) - first) * period / JOIN_PERIOD), 1)
    best = list[Join | None]([None] * parts)
    for rise in database.rising:
        until = rise.duration if rise.stand_time is None else rise.stand_time
        last = int(np.searchsorted(rise.time - rise.time[0], until - BEFORE_STAND))
        entries = np.arange(0, max(last, 1), step)
        distance = metric.distance(
            rise.orientation[entries, None],
            rise.joint_pos[entries, None],
            course.orientation[None, rows],
            course.joint_pos[None, rows],
        )  # (E, R)
        for part, columns in enumerate(np.array_split(np.arange(len(rows)), parts)):
            some = distance[:, columns]
            i, j = np.unravel_index(int(np.argmin(some)), some.shape)
            found, known = float(some[i, j]), best[part]
            if known is None or found < known.distance:
                best[part] = Join(
                    frame=int(rows[columns[j]]), rise=rise, entry=int(entries[i]), distance=found
                )
    return sorted((join for join in best if join), key=lambda join: join.distance)


def follow(course: Course, join: Join, robot: Robot) -> Course:
    """Continue a course by a stored rise, over a bridge."""
    period = robot.control_period
    before = course[: join.frame + 1]
    rise = join.rise
    at = np.arange(rise.time[join.entry], rise.time[-1] + 0.5 * period, period)
    frames = np.clip(np.searchsorted(rise.time, at - 1e-6), 0, len(rise.time) - 1)
    after = Course.aligned(rise, join.entry, before.end)[frames]
    count = round(BRIDGE / period)
    share = smooth_step(np.linspace(0.0, 1.0, count + 2)[1:-1])

    def mix(a: Array, b: Array) -> Array:
        return a + share[:, None] * (b - a)

    bridge = Course(
        position=mix(before.position[-1], after.position[0]),
        orientation=quaternion.slerp(
            np.tile(before.orientation[-1], (count, 1)),
            np.tile(after.orientation[0], (count, 1)),
            share,
        ),
        joint_pos=mix(before.joint_pos[-1], after.joint_pos[0]),
        joint_target=mix(before.joint_target[-1], after.joint_target[0]),
    )
    return before.then(bridge).then(after)


@dataclass(frozen=True, kw_only=True, eq=False)
class CapturedRise:
    """A clip made physical, and how near it comes to a rise."""

    motion: Motion
    """As it went undisturbed; its end class is "other" if it is not one to keep."""
    joined: str
    """Stored rise by which it ends; "" for the clip's own end."""
    stood: int
    """Disturbed worlds in which it stands, of those that the search did not see."""
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


class CapturedRiseMaker:
    """Makes retargeted clips of one robot physical.

    Its states are tracked by sampling, in some disturbed worlds at once. A clip whose own end does
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
        self._database = load_database(world.robot) if list_motions(world.robot) else None
        self._threads, self._monitor = threads, monitor or ProgressMonitor()
        self._judge = Experiment(world, threads=threads)
        self._simulated = 0.0

    def make(self, clip: RetargetedClip, seed: int) -> CapturedRise:
        """Make a retargeted clip physical."""
        world = self._world
        known = self._database.rising if self._database else ()
        course = bend_hands(Course.of(clip.motion), world, known)
        start = find_rest(world, course[:1].end)
        lying = place(world.robot, world.model, start)
        rng = np.random.default_rng([seed, 0])
        self._simulated = 0.0
        found = max(self._follow(course, lying, rng), key=lambda each: each.merit)
        left = self._budget - self._simulated
        if 0.0 < found.share < 1.0 and left > 0.0:
            found = self._vary(found, lying, left, rng)
        return self._record(found, clip, start, seed)

    def _follow(self, course: Course, lying: Array, rng: np.random.Generator) -> list[_Found]:
        """Follow the clip at once in disturbed worlds; where that falls, first undisturbed."""
        balance = round(OWN_END * len(course))
        nothing = np.zeros((0, self._world.robot.n))
        found = self._follow_disturbed(course, balance, nothing, LONG_WINDOW, 1, lying, rng)
        if max(each.share for each in found) < HOPEFUL and self._simulated < self._budget:
            around = self._find_way(course, balance, lying, rng)
            found += self._follow_disturbed(
                course, balance, around, SHORT_WINDOW, MORE_PASSES, lying, rng
            )
        return found

    def _follow_disturbed(
        self,
        course: Course,
        balance: int,
        around: Array,
        window: float,
        passes: int,
        lying: Array,
        rng: np.random.Generator,
    ) -> list[_Found]:
        """Follow the clip to its own end, and to those of stored rises, until one stands."""
        period = self._world.robot.control_period
        tracker = self._make_tracker(self._world, lying, WORLDS, MORE_SAMPLES, window, rng)
        own, found = [tracker.start], list[_Found]()
        for _ in range(passes):
            own = tracker.track(course, tracker.start, balance_from=balance, around=around)
            found.append(self._try_out(own[-1], lying, "", rng))
            if tracker.has_followed(course, own[-1]) or self._is_spent(tracker):
                break
            around = _improve(around, own[-1], is_whole=False)
        joins = find_joins(course, self._database, period) if self._database else []
        for join in joins:
            if found[-1].share >= HOPEFUL or self._is_spent(tracker):
                break
            at = join.frame // tracker.cycles
            if at < len(own):
                whole = follow(course, join, self._world.robot)
                over = join.frame + round((BRIDGE + SETTLING) / period)
                end = tracker.track(whole, own[at], balance_from=over)[-1]
                found.append(self._try_out(end, lying, join.rise.name, rng))
        self._simulated += tracker.simulated
        return found

    def _find_way(
        self, course: Course, balance: int, lying: Array, rng: np.random.Generator
    ) -> Array:
        """Find offsets with which a robot follows a clip undisturbed, pass by pass, (W, n).

        Each pass samples about what the one before found until shortly before it lost the clip.
        """
        around = np.zeros((0, self._world.robot.n))
        for world in dict.fromkeys([coarsen(self._world), self._world]):
            if self._simulated >= self._budget:
                break
            tracker = self._make_tracker(world, lying, 1, SAMPLES, SHORT_WINDOW, rng)
            for _ in range(PASSES):
                end = tracker.track(course, tracker.start, balance_from=balance, around=around)[-1]
                around = _improve(around, end, is_whole=tracker.has_followed(course, end))
                if tracker.has_followed(course, end) or self._is_spent(tracker):
                    break
            self._simulated += tracker.simulated
        return around

    def _make_tracker(
        self,
        world: World,
        lying: Array,
        worlds: int,
        samples: int,
        window: float,
        rng: np.random.Generator,
    ) -> SampledTracker:
        scenarios = CHECK_DISTURBANCE.sample(world, lying, worlds, rng)
        before = self._simulated

        def show(simulated: float) -> None:
            done = before + simulated
            phase = "following the clip [s simulated]"
            self._monitor.show(Progress(phase=phase, done=done, total=max(self._budget, done)))

        return SampledTracker(
            world,
            scenarios,
            samples=samples,
            window=window,
            rng=rng,
            threads=self._threads,
            budget=self._budget - before,
            show=show,
        )

    def _is_spent(self, tracker: SampledTracker) -> bool:
        return self._simulated + tracker.simulated >= self._budget

    def _try_out(
        self, branches: Branches, lying: Array, joined: str, rng: np.random.Generator
    ) -> _Found:
        """Play the targets of tracked states as motions, and take the best."""
        nominal = Scenarios.nominal(self._world, lying)
        outcome = self._judge.compare(nominal, list(branches.sent))
        self._simulated += outcome.record.duration
        merit = (outcome.stood + outcome.progress)[:, 0]
        best = int(np.argmax(merit))
        target, share = branches.sent[best], 0.0
        if outcome.stood[best, 0]:
            checks = CHECK_DISTURBANCE.sample(self._world, lying, JUDGED, rng)
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
        checks = CHECK_DISTURBANCE.sample(world, lying, JUDGED, rng)
        stood = self._judge.compare(checks, [found.target]).stood[0]
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
            overlap=float(np.asarray(outcome.overlap)),
            limb_error=measure_limb_error(motion, clip, robot),
            simulated=self._simulated,
        )


def _improve(around: Array, end: Branches, *, is_whole: bool) -> Array:
    """Replace offsets (W, n) by those of a pass, until shortly before it lost the clip."""
    found = end.best_offsets
    kept = len(found) if is_whole else max(len(found) - BACK, 0)
    return np.concatenate([found[:kept], around[kept:]])
