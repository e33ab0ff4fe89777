"""Join two stored motions to a quicker rise: the first until a time, then the second from another.

Both may be played faster. Of all combinations that stand undisturbed, the quickest are tried in
disturbed worlds; the best is varied until it stands in worlds that it has not seen, and is kept if
it stands in 44 of 48 others.

    python benchmarks/join_rises.py --first lateral_roll_to_prone --then prone_captured --name NAME
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

import humanoid_getup as hg
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.experiments.judging.outcome import Outcome, compute_share
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.filtering.dynamics_filter import CHECK_DISTURBANCE
from humanoid_getup.motions.build import with_entries
from humanoid_getup.motions.course import record_motion
from humanoid_getup.motions.motion import MAX_DURATION, STANDING, Motion, hold_last
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.target_search import TargetSearch, coarsen
from humanoid_getup.simulation.world import World
from robots.kinematics import place
from robots.quaternion import Array
from robots.smooth_step import smooth_step

BLEND = 0.32  # s in which the second motion's targets are reached
ENTRY_STEP, BEFORE_STAND = 0.3, 1.0  # s between entries of the second, and before its stand
BATCH = 16  # rollouts at a time
SECOND_COST = 0.04  # share of the disturbed worlds that 1 s is worth
JUDGED, KEPT = 48, 44


@dataclass(frozen=True, kw_only=True)
class JoinOptions:
    """Options of this script."""

    first: str
    """Motion of the robot, or an .npz file."""
    then: tuple[str, ...]
    """Rises that may follow it; those from prone or supine mirrored, too."""
    name: str
    strategy: str = "joined"
    robot: str = "human"
    cuts: tuple[float, ...] = (1.4, 1.9, 2.4, 3.0, 3.6)
    """Times at which the first one is left [s]."""
    begin: float = 0.0
    """Time at which it is begun [s]."""
    tempos: tuple[float, ...] = (1.0, 1.5, 2.0)
    """Factors on the speed of the first one."""
    then_tempos: tuple[float, ...] = (1.0,)
    """Factors on the speed of the second one."""
    entries: tuple[float, ...] = ()
    """Times at which the second one is entered [s]; default: every 0.3 s."""
    tried: int = 12
    """Combinations that are tried in disturbed worlds."""
    budget: float = 6000.0
    """Simulated time for varying targets [s]."""
    seed: int = 1
    threads: int = 1
    out: Path = Path()
    """Folder in which the motion is written."""


class Joiner:
    """Joins motions of one robot."""

    def __init__(self, options: JoinOptions) -> None:
        self.options, self.robot = options, hg.load_robot(options.robot)
        self.world = World(self.robot)
        self.first = find_motion(self.robot, options.first)
        row = round(options.begin / self.robot.control_period)
        self.start = find_rest(self.world, self.first.posture(row))
        self.lying = place(self.robot, self.world.model, self.start)
        self.rng = np.random.default_rng([options.seed, 0])
        self.experiment = Experiment(self.world, threads=options.threads)

    @property
    def _clips(self) -> dict[str, str]:
        """Return the clip that a joined rise is of, so that the clip does not join it again."""
        rises = [self.first, *(find_motion(self.robot, name) for name in self.options.then)]
        clips = [str(rise.provenance["clip"]) for rise in rises if "clip" in rise.provenance]
        return {"clip": clips[0]} if clips else {}

    def join(self) -> None:
        """Find the best combination, vary and judge it, and write the motion."""
        combinations = dict(self.combine())
        coarse = Experiment(coarsen(self.world), threads=self.options.threads)
        nominal = Scenarios.nominal(coarse.world, self.lying)
        quick: list[tuple[float, str]] = []
        texts = list(combinations)
        for some in (texts[k : k + BATCH] for k in range(0, len(texts), BATCH)):
            outcome = coarse.compare(nominal, [combinations[each] for each in some])
            stood, time = outcome.stood[:, 0], np.asarray(outcome.stand_time)[:, 0]
            quick += [(float(time[k]), some[k]) for k in np.flatnonzero(stood)]
        print(f"{len(quick)} of {len(combinations)} combinations stand", flush=True)
        best = self._choose(sorted(quick)[: self.options.tried], combinations)
        if best is not None:
            self._record(best, self._vary(combinations[best]))

    def combine(self) -> Iterator[tuple[str, Array]]:
        """Yield the targets of all combinations, each with a description."""
        options, period = self.options, self.robot.control_period
        entries = options.entries or np.arange(0.0, MAX_DURATION, ENTRY_STEP)
        for name in options.then:
            rise = find_motion(self.robot, name)
            until = (rise.stand_time or rise.duration) - BEFORE_STAND
            mirrored = rise.mirrored(self.robot)
            is_other_side = mirrored.start_class != rise.start_class
            for then in [rise] if is_other_side else [rise, mirrored]:
                for cut, tempo, entry, fast in itertools.product(
                    options.cuts,
                    options.tempos,
                    [e for e in entries if e < until],
                    options.then_tempos,
                ):
                    a = _play(self.first, options.begin, cut, tempo, period)
                    b = _play(then, float(entry), then.duration, fast, period)
                    share = smooth_step(np.linspace(0.0, (len(b) - 1) * period / BLEND, len(b)))[
                        :, None
                    ]
                    targets = np.concatenate([a, (b - (1.0 - share) * (b[0] - a[-1]))[1:]])
                    text = f"{tempo:g} x until {cut:g} s, {fast:g} x {then.name} from {entry:.1f} s"
                    yield text, self.robot.limit_targets(targets, self.start.joint_pos)

    def _choose(self, quick: list[tuple[float, str]], combinations: dict[str, Array]) -> str | None:
        """Choose a combination by its time and its stands in disturbed worlds."""
        worlds = CHECK_DISTURBANCE.sample(self.world, self.lying, BATCH, self.rng)
        best, merit = None, -np.inf
        for time, text in quick:
            share = compute_share(self.experiment.compare(worlds, [combinations[text]]).stood[0])
            print(f"{text}: {time:.2f} s, stands in {share:.0%}", flush=True)
            if share - SECOND_COST * time > merit:
                best, merit = text, share - SECOND_COST * time
        return best

    def _vary(self, target: Array) -> Array:
        """Vary targets until they stand in all worlds of a round that they have not seen."""
        search = TargetSearch(
            self.world, preference=Preference.of("time"), threads=self.options.threads
        )
        budget = self.options.budget
        while budget > 0.0:
            worlds = CHECK_DISTURBANCE.sample(self.world, self.lying, BATCH, self.rng)
            varied = search.search(worlds, target, budget, self.rng)
            print(f"{varied.generations} generations: stands in {varied.share:.0%}", flush=True)
            target, budget = varied.target, budget - varied.simulated
            if varied.share == 1.0 and varied.generations == 0:
                break
        return target

    def _record(self, text: str, target: Array) -> None:
        """Judge targets in worlds of another seed, and write them as a motion if they are kept."""
        rng = np.random.default_rng([self.options.seed, 1])
        checks = CHECK_DISTURBANCE.sample(self.world, self.lying, 1 + JUDGED, rng)
        stood = self.experiment.compare(checks, [target]).stood[0, 1:]
        sent = hold_last(target, len(target) + round(HOLD / self.robot.control_period))
        nominal = Scenarios.nominal(self.world, self.lying)
        outcome = Outcome(self.experiment.play(nominal, sent[None]), self.robot).take(0)
        print(f"{text}: stands in {stood.sum()} of {JUDGED} other worlds, {outcome.stand_time} s")
        if not outcome.stood or stood.sum() < KEPT:
            return
        motion = record_motion(
            self.world,
            self.start,
            target,
            outcome.record.qpos,
            name=self.options.name,
            start_class=self.first.start_class,
            end_class=STANDING,
            strategy=self.options.strategy,
            provenance={
                "program": "benchmarks/join_rises.py",
                **self._clips,
                "joined": f"{self.first.name}, {text}",
                "seed": self.options.seed,
                "disturbed_success": float(stood.mean()),
                "stand_time_s": float(outcome.stand_time),
            },
        )
        with_entries(self.world, motion).save(self.options.out / f"{motion.name}.npz")


def _play(motion: Motion, begin: float, end: float, tempo: float, period: float) -> Array:
    """Sample a motion's targets between two times [s], faster than they are by a factor."""
    count = round((end - begin) / tempo / period) + 1
    return motion.sample(motion.time[0] + begin + tempo * period * np.arange(count))


if __name__ == "__main__":
    Joiner(tyro.cli(JoinOptions)).join()
