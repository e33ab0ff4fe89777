"""The benchmark over bodies: start states of their makers, and falls of all classes.

Its parts are a few rises of a body by a method from one kind of starts; `summarize_bodies` puts
their results together.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from drivers import Twin
from humanoid_getup.benchmarks.bench_result import CaseBench
from humanoid_getup.benchmarks.bodies.body_rise import BodyRise, BodyRises, BodySummary
from humanoid_getup.benchmarks.bodies.body_starts import BodyStarts
from humanoid_getup.benchmarks.bodies.head_gauge import HeadGauge
from humanoid_getup.benchmarks.bodies.published_body import PublishedBody
from humanoid_getup.benchmarks.conditions import Conditions, describe_conditions
from humanoid_getup.benchmarks.part import Part, PartResult, Step
from humanoid_getup.benchmarks.rise import rise_once
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.benchmarks.whole import FallsByClass, sample_by_class
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.starts.falls import CLASSES, UNCLASSED
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RisePlan, RiseStatus
from robots import FULL_TORQUE, Posture, TorqueLimit

STARTS, FALLS = "their starts", "falls"
"""Kinds of starts: states of a body's makers, and falls with random joints."""
TOGETHER = 10  # rises of a part


@dataclass(frozen=True, kw_only=True)
class NoMotions:
    """The plan of a robot that has no motions: nothing."""

    world: World
    torque_limit: TorqueLimit

    def plan(self, _start: Posture, _rng: np.random.Generator) -> RisePlan:
        """Return a plan with nothing to play."""
        return RisePlan(status=RiseStatus.NOT_PLANNED, detail="the robot has no motions")


@dataclass(frozen=True, kw_only=True)
class BenchedBody:
    """A body of others as a robot of ours."""

    published: PublishedBody
    world: World
    starts: BodyStarts
    gauge: HeadGauge
    methods: Sequence[RiseMethod]
    seed: int
    each: int
    """Falls of each class."""
    count: int
    """Start states of its makers."""
    search_budget: float
    """Of each plan, in simulated time [s]."""

    @property
    def name(self) -> str:
        """Return its name."""
        return self.published.name

    @cached_property
    def falls(self) -> FallsByClass:
        """Sample the falls that all methods get."""
        return sample_by_class(self.world, self.each, self.seed)

    @cached_property
    def their_falls(self) -> FallsByClass:
        """Draw the start states that all methods get, by the class in which each settled."""
        falls = self.starts.sample(self.world, self.count, self.seed)
        found = {fall.start_class for fall in falls}
        classes = tuple(name for name in (*CLASSES, UNCLASSED) if name in found)
        return FallsByClass(falls=falls, classes=classes, missing={})

    def parts(self) -> Iterator[Part]:
        """Return the parts that a run has."""
        for kind in (STARTS, FALLS):
            for method in self.methods:
                for rows in self.list_rows(kind):
                    yield Part(
                        name=name_part(self.name, method.name, kind, rows),
                        count=len(rows),
                        depends=self._depend(method, kind),
                        kind=BodyRises,
                        run=partial(self._rise, method, kind, rows),
                    )

    def list_rows(self, kind: str) -> Iterator[range]:
        """List the numbers of the starts of one kind, those of a part together."""
        count = self.each * len(CLASSES)
        if kind == STARTS:
            count = min(self.count, len(self.starts))
        for first in range(0, count, TOGETHER):
            yield range(first, min(first + TOGETHER, count))

    def _depend(self, method: RiseMethod, kind: str) -> dict[str, object]:
        starts = {"starts": self.starts.source_sha256}  # drawn alike, however many
        return {
            "world": hashlib.sha256(self.world.content).hexdigest(),
            "seed": self.seed,
            "method": method.fingerprint,
            **(starts if kind == STARTS else {"n": self.each}),
        }

    def _rise(self, method: RiseMethod, kind: str, rows: range, report: Step) -> BodyRises:
        falls = self.their_falls if kind == STARTS else self.falls
        strategy = method.make(self.world, FULL_TORQUE)
        rises = []
        for number, fall in zip(rows, falls.falls[rows.start : rows.stop], strict=False):
            options = SessionOptions(
                start_class=fall.start_class,
                preflight=method.preflight,
                settle=kind == FALLS,  # limp, a robot does not stay in a start of its makers
            )
            twin = Twin(self.world, fall.posture)
            rise = rise_once(twin, strategy, [self.seed, 1, number], options)
            rises.append(BodyRise.of(rise, self.gauge, fall.start_class))
            report(rises[-1])
        return BodyRises(classes=falls.classes, missing=falls.missing, rises=rises)


class BodyCase(BodySummary, frozen=True, kw_only=True):
    """The rises of a body by a method from one kind of starts, over all and by class."""

    body: str
    method: str
    starts: str
    classes: dict[str, BodySummary]
    failures: list[str]
    """Number of the start, from 1, its class, and why no stand was held from there."""


class BodyBench(CaseBench[BodyCase], frozen=True, kw_only=True):
    """The results of all bodies."""

    n_starts: int
    """Start states of each body."""
    search_budget_s: float
    """Of each plan, in simulated time."""
    published: list[PublishedBody]
    """What the makers of the bodies report."""
    conditions: dict[str, Conditions]
    notes: list[str]
    """What was not measured, with reasons."""
    command: str
    """Command line that repeats it."""


def name_case(body: str, method: str, kind: str) -> str:
    """Name the rises of a body by a method from one kind of starts."""
    return f"{body}: {method}, {kind}"


def name_part(body: str, method: str, kind: str, rows: range) -> str:
    """Name the rises of a case from the starts with some numbers."""
    return f"{name_case(body, method, kind)} {rows.start + 1} to {rows.stop}"


def summarize_bodies(
    bodies: Sequence[BenchedBody],
    results: Mapping[str, PartResult],
    *,
    notes: Sequence[str] = (),
    command: str,
) -> BodyBench:
    """Put the results of all parts together, by the names of the parts."""
    first, cases, missing = bodies[0], dict[str, BodyCase](), dict[str, None]()
    for body in bodies:
        for kind in (STARTS, FALLS):
            for method in body.methods:
                names = (body.name, method.name, kind)
                parts = list[BodyRises]()
                for rows in body.list_rows(kind):
                    part = results[name_part(*names, rows)]
                    assert isinstance(part, BodyRises)
                    parts.append(part)
                result = BodyRises.join(parts)
                cases[name_case(*names)] = _summarize(result, *names)
                missing |= dict.fromkeys(
                    f"No fall of {body.name} ends {side}: {reason}."
                    for side, reason in result.missing.items()
                )
    return BodyBench(
        name="bodies",
        seed=first.seed,
        n=first.each,
        n_starts=first.count,
        search_budget_s=first.search_budget,
        cases=cases,
        published=[body.published for body in bodies],
        conditions={
            body.name: describe_conditions(body.world, FULL_TORQUE.on(body.world.robot))
            for body in bodies
        },
        notes=[*notes, *missing],
        command=command,
    )


def _summarize(result: BodyRises, body: str, method: str, kind: str) -> BodyCase:
    by_class = {
        name: [rise for rise in result.rises if rise.bench_class == name] for name in result.classes
    }
    return BodyCase.over(
        result.rises,
        body=body,
        method=method,
        starts=kind,
        classes={name: BodySummary.over(rises) for name, rises in by_class.items()},
        failures=[
            f"{number}, {rise.bench_class}: {rise.reason}"
            for number, rise in enumerate(result.rises, 1)
            if not rise.stood
        ],
    )
