"""The whole benchmark of a robot: same falls and judge for every method and torque cap.

Its parts are the rises of a method under a cap, the plays of a stored motion, and the rises under a
disturbance; `summarize_parts` puts their results together.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType, convert

from humanoid_getup.benchmarks.bench_result import (
    CaseBench,
    KeptRise,
    MeasuredRise,
    RefusableSummary,
)
from humanoid_getup.benchmarks.conditions import Conditions, describe_conditions
from humanoid_getup.benchmarks.disturbed import DISTURBANCES, DisturbedWays
from humanoid_getup.benchmarks.motions import MotionPiece, MotionSummary, measure_motion
from humanoid_getup.benchmarks.part import DisturbedRises, MethodRises, Part, PartResult, Step
from humanoid_getup.benchmarks.rise import (
    Report,
    list_pieces,
    rise_all,
    rise_from,
    summarize_classes,
)
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.benchmarks.torque_cap import TorqueCap
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.experiments.starts.drop import FallError
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, sample_falls
from humanoid_getup.motions.motion import Motion
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots.servo import LimitMode

CASES = tuple(DISTURBANCES)
QUICK_CASES = CASES[:2]
FEWER = 4  # times fewer falls of each class are disturbed
PLAYED, DISTURBED = "motion ", "disturbed "
"""Prefixes of the names of parts that are not rises by a method."""


@dataclass(frozen=True, kw_only=True)
class FallsByClass:
    """Falls in the order of their classes, as many of each."""

    falls: list[Fall]
    classes: tuple[str, ...]
    missing: dict[str, str]
    """Classes in which the robot does not come to lie, and why they were left out."""


class CapSummary(RiseSummary, frozen=True, kw_only=True):
    """The rises of a method under a cap, over all and by class."""

    method: str
    cap: str
    share_of_stall: float
    torque_limit_nm: float | None
    limit_by: LimitMode | None
    classes: dict[str, RiseSummary]


class Pictures(msgspec.Struct, frozen=True, kw_only=True):
    """Files with pictures of a benchmark."""

    plot: str | None = None
    strips: dict[str, str] = {}
    """Film strip of a rise of each class."""
    method: str | UnsetType = UNSET
    """Method whose rises are drawn."""
    reason: str = ""
    """Reason why there are no strips."""


class WholeBench(CaseBench[CapSummary], frozen=True, kw_only=True):
    """The results of all parts."""

    missing_classes: dict[str, str]
    motions: dict[str, MotionSummary]
    disturbed: dict[str, RefusableSummary]
    notes: list[str]
    """Parts that were not measured, with reasons."""
    command: str
    """Command line that repeats it."""
    conditions: Conditions
    pictures: Pictures


@dataclass(frozen=True, kw_only=True)
class Whole:
    """The whole benchmark of a robot: methods, caps and falls."""

    world: World
    methods: Sequence[RiseMethod]
    motions: Sequence[Motion]
    """Motions that are played from their own start."""
    caps: Sequence[TorqueCap]
    planner: PlannedRise | None
    """Plans for disturbed worlds; None without motions."""
    policies: Mapping[str, Strategy]
    """Policies in disturbed worlds, at stall torque."""
    disturbances: Sequence[str]
    seed: int
    each: int
    """Falls of each class."""
    threads: int = 0
    """Threads that step the physics of a motion that is played; 0 for one per processor."""

    @cached_property
    def falls(self) -> FallsByClass:
        """Sample the falls that all methods get."""
        return sample_by_class(self.world, self.each, self.seed)

    def parts(self) -> list[Part]:
        """Return the parts that a run has."""
        return [*self._rise_parts(), *self._motion_parts(), *self._disturbed_parts()]

    def repeat(self, method: RiseMethod, number: int) -> RiseResult:
        """Repeat the rise from a fall under the first cap."""
        strategy, fall = method.make(self.world, self.caps[0].limit), self.falls.falls[number]
        return rise_from(strategy, fall, number, self.seed, preflight=method.preflight)

    def _rise_parts(self) -> Iterator[Part]:
        for cap in self.caps:
            for method in self.methods:
                yield Part(
                    name=name_rises(method.name, cap),
                    count=self.each * len(CLASSES),
                    depends=self._depend(
                        method=method.fingerprint,
                        torque_limit_nm=cap.limit.value,
                        limit_by=cap.limit.by,
                    ),
                    kind=MethodRises,
                    run=partial(self._rise, method, cap),
                )

    def _rise(self, method: RiseMethod, cap: TorqueCap, report: Report) -> MethodRises:
        falls = self.falls
        pieces = list_pieces(
            falls.falls, self.seed, classes=falls.classes, preflight=method.preflight
        )
        strategy = method.make(self.world, cap.limit)
        rises = rise_all(strategy, pieces, report)
        kept = convert(rises, list[KeptRise], from_attributes=True)
        return MethodRises(classes=falls.classes, missing=falls.missing, rises=kept)

    def _motion_parts(self) -> Iterator[Part]:
        def play(motion: Motion, number: int, report: Step) -> MotionSummary:
            piece = MotionPiece(motion=motion, number=number, seed=self.seed, each=self.each)
            summary = measure_motion(self.world, piece, threads=self.threads)
            report(summary)
            return summary

        for number, motion in enumerate(self.motions):
            yield Part(
                name=f"{PLAYED}{motion.name}",
                count=1,
                depends=self._depend(motion=_hash(motion.joint_target, motion.time)),
                kind=MotionSummary,
                run=partial(play, motion, number),
            )

    def _disturbed_parts(self) -> Iterator[Part]:
        if self.planner is None:
            return
        ways = DisturbedWays(planner=self.planner, policies=self.policies)
        each = -(-self.each // FEWER)

        def rise(case: str, report: Report) -> DisturbedRises:
            counts = dict.fromkeys(self.falls.classes, each)
            falls = sample_falls(self.world, counts, np.random.default_rng(self.seed))
            rises = list[MeasuredRise]()
            for number, fall in enumerate(falls):
                changes = {case: DISTURBANCES[case]}
                rises += ways.measure(fall, number, self.seed, changes)
                for rise in rises[-len(ways.names) :]:
                    report(rise)
            return DisturbedRises(cases=RefusableSummary.table(rises, (case,), ways.names))

        by_name = {method.name: method.fingerprint for method in self.methods}
        for case in self.disturbances:
            yield Part(
                name=f"{DISTURBED}{case}",
                count=each * len(CLASSES) * len(ways.names),
                depends=self._depend(disturbance=repr(DISTURBANCES[case]), **by_name),
                kind=DisturbedRises,
                run=partial(rise, case),
            )

    def _depend(self, **others: object) -> dict[str, object]:
        world = hashlib.sha256(self.world.content).hexdigest()
        return {"world": world, "seed": self.seed, "n": self.each, **others}


def name_rises(method: str, cap: TorqueCap) -> str:
    """Name the rises of a method under a cap."""
    return f"{method}, {cap.name}"


def sample_by_class(world: World, each: int, seed: int) -> FallsByClass:
    """Sample equally many falls of each class; skip classes in which the robot never lies.

    Raises:
        FallError: if it lies in none.
    """
    try:
        falls = sample_falls(world, dict.fromkeys(CLASSES, each), np.random.default_rng(seed))
        return FallsByClass(falls=falls, classes=CLASSES, missing={})
    except FallError:
        found: dict[str, list[Fall]] = {}
        missing: dict[str, str] = {}
    for number, name in enumerate(CLASSES):
        try:
            found[name] = sample_falls(world, {name: each}, np.random.default_rng([seed, number]))
        except FallError as error:
            missing[name] = str(error)
    falls = [fall for some in found.values() for fall in some]
    if not falls:
        raise FallError("; ".join(missing.values()))
    return FallsByClass(falls=falls, classes=tuple(found), missing=missing)


def summarize_parts(
    whole: Whole, results: Mapping[str, PartResult], *, notes: list[str], command: str
) -> WholeBench:
    """Put the results of all parts together, by the names of the parts."""
    rises = {name: one for name, one in results.items() if isinstance(one, MethodRises)}
    motions = {name: one for name, one in results.items() if isinstance(one, MotionSummary)}
    disturbed = [one.cases for one in results.values() if isinstance(one, DisturbedRises)]
    return WholeBench(
        name="all",
        robot=whole.world.robot.name,
        scene=whole.world.scene.name,
        seed=whole.seed,
        n=whole.each,
        missing_classes=next((one.missing for one in rises.values()), {}),
        cases={
            name: _summarize(rises[name], method, cap)
            for cap in whole.caps
            for method in whole.methods
            for name in (name_rises(method.name, cap),)
        },
        motions={name.removeprefix(PLAYED): motion for name, motion in motions.items()},
        disturbed={name: case for cases in disturbed for name, case in cases.items()},
        notes=notes,
        command=command,
        conditions=describe_conditions(whole.world, whole.caps[0].limit),
        pictures=Pictures(reason="there is no rise to draw"),
    )


def _summarize(result: MethodRises, method: RiseMethod, cap: TorqueCap) -> CapSummary:
    return CapSummary.of(
        result.rises,
        method=method.name,
        cap=cap.name,
        share_of_stall=cap.share,
        torque_limit_nm=cap.limit.value,
        limit_by=cap.limit.by,
        classes=summarize_classes(result.rises, result.classes),
    )


def _hash(*arrays: np.ndarray) -> str:
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()
