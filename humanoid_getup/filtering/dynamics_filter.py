"""The dynamics filter: turns a planned rise into targets that real servos can follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Disturbance, Normal, Scenarios, Uniform
from humanoid_getup.experiments.judging.outcome import DEEP_OVERLAP, Outcome, compute_share
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.rollouts import LATEST_STAND, Experiment, FeedbackLaw
from humanoid_getup.filtering.candidate import Candidate, CandidateRollout, Reference, compose
from humanoid_getup.filtering.separation import MARGINS, Separation
from humanoid_getup.filtering.tracking import FIRST_HOLD, Tracker
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.target_search import TargetSearch, coarsen
from humanoid_getup.planning.planner_settings import DEFAULTS, PlannerSettings
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

LONG_HOLD = FIRST_HOLD + LATEST_STAND  # s, so that every stand that a check takes shows
CHECKS = 16  # disturbed rollouts of a motion before it is returned
CHECK_DISTURBANCE = Disturbance(
    joints=Normal(np.radians(1.5)),
    turn=Normal(np.radians(3.0)),
    ground_friction=Uniform(0.6, 1.1),
    supply=Uniform(0.96, 1.04),
)
HARD_DISTURBANCE = Disturbance(  # of a rise that must have a margin
    joints=Normal(np.radians(5.0)),
    turn=Normal(np.radians(10.0)),
    ground_friction=Uniform(0.3, 1.3),
    supply=Uniform(0.85, 1.05),
)
TOUCH = 0.5 * DEEP_OVERLAP  # m; what a rollout avoids, so that the robot does not collide
FEW = 2  # worlds in which a rise that stands is improved
ENOUGH, ENOUGH_IF_COARSE = 1.0, 0.9  # share of a check that must stand to stop searching
HOPELESS = 0.4  # of the standing neck height: what never rose so far is not varied
ROUNDING = 0.1  # s by which a stand may begin after the motion's end
FIRST_CHECKS = 4  # rollouts of a check after which it may end, if it must be better than another


class DynamicsFilter:
    """Tracks references in forward simulation, many at a time.

    Velocity-driven tracking and the virtual actuator are both written as targets of
    position servos, so the result can be sent to the robot as it is: the targets never
    leave the joints' ranges nor move faster than the servos, and the torques stay within
    the servos' limits because the simulated servos have the same.

    For bodies with many contacts, whose physics is expensive, rollouts and searches are those of a
    `coarse_world`, a search ends sooner, and limbs that touch are left to the improvement; checks
    are always those of the world itself.
    """

    def __init__(
        self,
        world: World,
        settings: PlannerSettings = DEFAULTS,
        *,
        monitor: ProgressMonitor | None = None,
    ) -> None:
        """Prepare for a world."""
        self._monitor = monitor or ProgressMonitor()
        self.world, self.torque_limit = world, settings.torque_limit.on(world.robot)
        self.preference = Preference.of(settings.prefer)
        self.count = 0
        """Rollouts for this plan."""
        self.searched = 0.0
        """Time that searches have simulated for this plan [s]."""
        self._root = world.robot.layout(world.model).root_qpos
        self._fit = GroundFit(world)
        self._search = TargetSearch(
            coarsen(world),
            preference=self.preference,
            threads=settings.threads,
            monitor=self._monitor,
        )
        self._coarse = self._fine = self._search.experiment
        self._is_coarse = self._coarse.world is not world
        if self._is_coarse:
            self._fine = Experiment(world, threads=settings.threads)
        self.enough = ENOUGH_IF_COARSE if self._is_coarse else ENOUGH
        """Share of the disturbed rollouts that must stand to stop searching."""
        self.hopeless = HOPELESS * world.robot.standing_neck_height if self._is_coarse else 0.0
        """Height of the neck [m] to which a failed rollout must have come to be varied."""
        self._separation = Separation(world)

    def roll_out(self, start: Posture, candidates: list[Candidate]) -> list[CandidateRollout]:
        """Track every candidate from the start posture, at rest."""
        self._monitor.begin(f"tracking {len(candidates)} candidates in physics")
        references = [self._refer(c) for c in candidates]
        tracker = Tracker(self.world, start, references, candidates, self.torque_limit)
        record = self._play_nominal(start, len(candidates), tracker, self._coarse)
        return self._read(record, candidates, tracker.moving, tracker.joined)

    def fit_legs(self, rollout: CandidateRollout) -> Candidate:
        """Make a candidate whose legs fit the ground where a rollout of it came.

        Later samples take the ground where its root was highest.
        """
        candidate = rollout.candidate
        if candidate.slowdown is not None:  # its cycles are not those of the reference
            return candidate
        root = rollout.qpos[rollout.joined :, self._root : self._root + 7]
        height = root[:, 2] - self.world.scene.ground.height(root[:, 0], root[:, 1])
        return replace(candidate, seen=root[: int(height.argmax()) + 1])

    def _refer(self, c: Candidate) -> Reference:
        connection = c.connection
        motion, frame = connection.motion, connection.frame
        reference = compose(
            self.world, c.path, motion, frame, c.tempo, self._fit, c.seen, fits=c.fits
        )
        return reference if c.before is None else reference.after(c.before)

    def check(
        self,
        start: Posture,
        target: Array,
        rng: np.random.Generator,
        count: int = CHECKS,
        *,
        least: float = 0.0,
    ) -> float:
        """Replay targets (T, n) without feedback, from the start and from disturbed ones.

        Returns the share that ended in a held stand; 0 if the undisturbed one did not, or if the
        share would be below the ``least``.
        """
        self._monitor.begin(f"checking a rise in {count} disturbed worlds")
        scenarios = self._disturb(start, rng, count)
        if least == 0.0:
            return self._check_in(self._fine, scenarios, target)[0]
        first, rest = np.split(np.arange(count), [FIRST_CHECKS])  # number 0 is undisturbed
        stood = self._compare(self._fine, scenarios.take(first), target).stood[0]
        if compute_share(stood) == 0.0 or np.sum(~stood) > (1.0 - least) * count:
            return 0.0
        # None of the rest is the undisturbed one, at whose fall a comparison gives up.
        others = self._compare(self._fine, scenarios.take(rest), target, give_up=False).stood[0]
        share = compute_share(np.concatenate([stood, others]))
        return share if share >= least else 0.0

    def _check_in(
        self, experiment: Experiment, scenarios: Scenarios, target: Array
    ) -> tuple[float, float]:
        """Return the share that stood, as a check does, and the time that was simulated [s]."""
        outcome = self._compare(experiment, scenarios, target)
        return compute_share(outcome.stood[0]), outcome.record.duration

    def _compare(
        self, experiment: Experiment, scenarios: Scenarios, target: Array, *, give_up: bool = True
    ) -> Outcome:
        """Play targets (T, n) in K scenarios and count them, (1, K)."""
        outcome = experiment.compare(scenarios, [target], give_up=give_up)
        self.count += outcome.stood.size
        return outcome

    def confirm(self, start: Posture, rollout: CandidateRollout) -> CandidateRollout:
        """Return a rollout as it is in the world itself: rollouts are those of a coarse one."""
        if not self._is_coarse:
            return rollout
        target = rollout.target[: rollout.moving]
        return self._replay(start, rollout.candidate, [target], LONG_HOLD, self._fine)[0]

    def search(
        self, start: Posture, rollout: CandidateRollout, budget: float, rng: np.random.Generator
    ) -> tuple[CandidateRollout, float]:
        """Search variations of a rollout's targets that stand under more disturbances.

        What stands in all the worlds it was searched in is checked in fresh ones. If it falls in
        some, the search continues from it in those. The budget is simulated time [s]. Returns the
        rollout of the best targets, and the share of their check in fresh worlds.
        """
        target = rollout.target[: rollout.moving]
        worlds = self._disturb(start, rng)
        while True:
            found = self._search.search(worlds, target, budget, rng)
            self.count += found.rollouts
            target, worlds = found.target, self._disturb(start, rng)
            share, simulated = self._check_in(self._coarse, worlds, target)
            budget -= found.simulated + simulated
            self.searched += found.simulated + simulated
            is_stuck, is_robust = found.share < 1.0, share == 1.0
            if is_stuck or is_robust or budget <= 0.0:
                break
        if self._is_coarse:
            share = self._check_in(self._fine, worlds, target)[0]
        played = self._replay(start, rollout.candidate, [target], LONG_HOLD, self._fine)[0]
        return played, share

    def separate(
        self, start: Posture, rollout: CandidateRollout, budget: float
    ) -> CandidateRollout:
        """Separate limbs that touch in a rollout that stands, by shifting its targets.

        The result stands undisturbed; it is the rollout itself if no shift helps, or where physics
        is expensive. No shift is tried once the budget of simulated time [s] is spent.
        """
        margins = [] if self._is_coarse else list(MARGINS)
        while margins and budget > 0.0 and (overlap := rollout.measure_overlap(TOUCH)) > 0.0:
            self._monitor.begin("separating limbs that touch")
            target = rollout.target[: rollout.moving]
            shifts = self._separation.shift(
                rollout.qpos, rollout.overlap, rollout.moving, margins[0]
            )
            motions = [self.world.robot.limit_targets(target + s, start.joint_pos) for s in shifts]
            played = self._replay(start, rollout.candidate, motions)
            budget -= sum(len(r.target) for r in played) * self.world.robot.control_period
            standing = [r for r in played if r.stood]
            least = min(standing, key=lambda r: r.measure_overlap(TOUCH), default=rollout)
            if least.measure_overlap(TOUCH) < overlap:
                rollout = least
            else:
                margins.pop(0)
        return rollout

    def improve(
        self, start: Posture, rollout: CandidateRollout, budget: float, rng: np.random.Generator
    ) -> CandidateRollout:
        """Search variations of a rollout's targets that cost less, or are more robust.

        The rollout stands under every disturbance, and is returned unless a better one stands
        in all of a fresh check, too. The budget is simulated time [s].
        """
        target = rollout.target[: rollout.moving]
        if self.preference.wants_margin:
            found = self._search.search(
                self._disturb(start, rng, disturbance=HARD_DISTURBANCE), target, budget, rng
            )
            better = [] if found.target is target else [found.target]
        else:
            few = self._disturb(start, rng).take(np.arange(FEW))
            found = self._search.improve(few, target, budget, rng)
            better = found.targets
        self.count += found.rollouts
        self.searched += found.simulated
        for one in better:
            if self.check(start, one, rng, least=1.0) == 1.0:
                played = self._replay(start, rollout.candidate, [one], LONG_HOLD, self._fine)[0]
                if played.stood:
                    return played
        return rollout

    def replay(
        self, start: Posture, rollouts: list[CandidateRollout], targets: list[Array]
    ) -> list[CandidateRollout]:
        """Play other targets, each (T, n), for rollouts, in the undisturbed world."""
        played = self._replay(start, rollouts[0].candidate, targets)
        return [
            replace(one, candidate=rollout.candidate)
            for one, rollout in zip(played, rollouts, strict=True)
        ]

    def _replay(
        self,
        start: Posture,
        candidate: Candidate,
        targets: list[Array],
        hold: float = FIRST_HOLD,
        experiment: Experiment | None = None,
    ) -> list[CandidateRollout]:
        """Play targets, each (T, n), undisturbed, and hold the last for a time [s]."""
        robot, n = self.world.robot, len(targets)
        moving = np.array([len(target) for target in targets])
        length = int(moving.max()) + round(hold / robot.control_period)
        longer = np.array([hold_last(target, length) for target in targets])
        record = self._play_nominal(start, n, longer, experiment or self._coarse)
        return self._read(record, [candidate] * n, moving, np.zeros(n, dtype=int))

    def _disturb(
        self,
        start: Posture,
        rng: np.random.Generator,
        count: int = CHECKS,
        disturbance: Disturbance = CHECK_DISTURBANCE,
    ) -> Scenarios:
        lying = place(self.world.robot, self.world.model, start)
        disturbance = disturbance.on_slope(self.world.scene)
        return disturbance.sample(self.world, lying, count, rng, self.torque_limit)

    def _play_nominal(
        self, start: Posture, count: int, source: Array | FeedbackLaw, experiment: Experiment
    ) -> Record:
        """Play robots from one posture, undisturbed, and count them."""
        self.count += count
        lying = place(self.world.robot, self.world.model, start)
        scenario = Scenarios.nominal(self.world, lying, self.torque_limit)
        return experiment.play(scenario.tile(count), source)

    def _read(
        self,
        record: Record,
        candidates: list[Candidate],
        moving: NDArray[np.int_],
        joined: NDArray[np.int_],
    ) -> list[CandidateRollout]:
        """Judge the rollouts of candidates."""
        outcome = Outcome(record, self.world.robot, hold_time=FIRST_HOLD - ROUNDING)
        cost, stood = self.preference.cost(outcome), outcome.stood & ~outcome.overloaded
        collides, neck = np.asarray(outcome.collides), record.stance.neck_height.max(axis=1)
        assert record.target is not None and record.overlap is not None  # every rollout has them
        return [
            CandidateRollout(
                candidate=candidate,
                outcome=outcome.take(i),
                cost=float(cost[i]),
                moving=int(moving[i]),
                joined=int(joined[i]),
                stood=bool(stood[i]),
                collides=bool(collides[i]),
                peak_neck=float(neck[i]),
                target=record.target[i],
                overlap=record.overlap[i],
            )
            for i, candidate in enumerate(candidates)
        ]
