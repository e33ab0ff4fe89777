"""Rises in disturbed worlds by strategies that know only the nominal one, from the same falls."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from drivers import Command, Twin
from humanoid_getup.benchmarks.bench_result import CaseBench, MeasuredRise, RefusableSummary
from humanoid_getup.benchmarks.pieces import RunPieces, collect, one_by_one
from humanoid_getup.benchmarks.rise import BENCH_CLASSES, Report, rise_once
from humanoid_getup.benchmarks.world_change import (
    WorldChange,
    disturb_start,
    disturb_world,
    turn_head,
)
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.starts.falls import Fall, sample_falls
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan, RisePlan, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, TorqueLimit
from robots.quaternion import Array

OPEN_LOOP, FEEDBACK = "plan, open loop", "plan"
DISTURBANCES = {
    "nominal": WorldChange(),
    "300 g on the back": WorldChange(load=0.3),
    "slope +5 deg": WorldChange(slope=math.radians(5.0)),
    "slope -5 deg": WorldChange(slope=math.radians(-5.0)),
    "step of 2 cm": WorldChange(step=0.02),
    "left shoulder limp": WorldChange(strength=0.0, joint="l_sho_pitch"),
    "one servo at 60 %": WorldChange(strength=0.6),
    "friction 0.3": WorldChange(friction=0.3),
    "mass +10 %": WorldChange(mass=1.1),
    "mass -10 %": WorldChange(mass=0.9),
    "center of mass 5 mm off": WorldChange(com_shift=0.005),
    "supply 11.0 V": WorldChange(voltage=11.0),
    "supply 12.6 V": WorldChange(voltage=12.6),
    "start 10 deg off": WorldChange(start_angle=math.radians(10.0)),
}
"""The disturbances, by their names in tables."""


class WeakTwin(Twin):
    """A twin with weaker servos: they have a share of their torque and gain."""

    def __init__(self, world: World, start: Posture, strength: Array, voltage: float | None):
        """Build a twin in a world at a start; ``strength`` is the share of each servo, (n,)."""
        super().__init__(world, start, voltage=voltage)
        self._strength = strength

    def write(self, command: Command) -> Command:
        """Apply a command for one period with the servos' strength; return it as sent."""
        limit = np.minimum(command.torque_limit, self.robot.max_torque)
        weak = replace(
            command,
            torque_limit=limit * self._strength,
            gain_scale=command.gain_scale * self._strength,
        )
        sent = super().write(weak)
        return replace(sent, torque_limit=limit, gain_scale=command.gain_scale)


@dataclass(frozen=True, kw_only=True)
class SamePlan:
    """A strategy that returns the same plan for every start."""

    world: World
    torque_limit: TorqueLimit
    rise: RisePlan

    def plan(self, _start: Posture, _rng: np.random.Generator) -> RisePlan:
        """Return the plan."""
        return self.rise


@dataclass(frozen=True, kw_only=True)
class DisturbedRise:
    """One robot in one disturbed world."""

    world: World
    start: Posture
    strength: Array
    """Share of torque and gain that each servo has, (n,)."""
    voltage: float | None
    """Supply [V]; ``None`` for the nominal one."""

    @staticmethod
    def of(world: World, fall: Fall, change: WorldChange, seed: list[int]) -> DisturbedRise:
        """Disturb a world and a fall; a seed makes it reproducible."""
        rng, robot = np.random.default_rng(seed), world.robot
        direction = rng.uniform(0.0, 2.0 * math.pi)
        weak = int(rng.integers(robot.n))
        if change.joint is not None:
            weak = robot.joint_names.index(change.joint)
        strength = np.ones(robot.n)
        strength[weak] = change.strength
        return DisturbedRise(
            world=disturb_world(world, change, direction),
            start=disturb_start(world, turn_head(fall.posture), change, rng),
            strength=strength,
            voltage=change.voltage,
        )

    def rise(self, strategy: Strategy, fall: Fall, seed: list[int]) -> RiseResult:
        """Get up once."""
        options = SessionOptions(start_class=fall.start_class, support=self.world.scene.support)
        twin = WeakTwin(self.world, self.start, self.strength, self.voltage)
        return rise_once(twin, strategy, seed, options)


@dataclass(frozen=True, kw_only=True)
class DisturbedPiece:
    """One of many falls, from which every way rises in every disturbed world."""

    number: int
    fall: Fall
    seed: int
    cases: tuple[str, ...]
    """Names of the disturbances."""


RunDisturbed: TypeAlias = RunPieces[DisturbedPiece, list[MeasuredRise]]


@dataclass(frozen=True, kw_only=True)
class DisturbedWays:
    """Ways to get up in disturbed worlds: plans, with feedback or not, and policies.

    Each fall is planned once, undisturbed. Preflight and supervision know the nominal world, the
    judge knows the true one.
    """

    planner: PlannedRise
    """Plans in the nominal, flat world."""
    policies: Mapping[str, Strategy]
    """Further strategies for that world, by name."""

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the ways."""
        return OPEN_LOOP, FEEDBACK, *self.policies

    def measure(self, piece: DisturbedPiece) -> list[MeasuredRise]:
        """Rise from one fall in every disturbed world, in every way."""
        world, fall, number, seed = self.planner.world, piece.fall, piece.number, piece.seed
        ways = _plan(self.planner, fall, [seed, 1, number]) | dict(self.policies)
        rises = list[MeasuredRise]()
        for case in piece.cases:
            trial = DisturbedRise.of(world, fall, DISTURBANCES[case], [seed, 2, number])
            for way, strategy in ways.items():
                rise = trial.rise(strategy, fall, [seed, 3, number])
                rises.append(MeasuredRise.refusable(rise, case=case, way=way, fall=number))
        return rises


def bench_disturbed(
    ways: DisturbedWays,
    *,
    seed: int,
    each: int,
    classes: Sequence[str] = BENCH_CLASSES,
    cases: Sequence[str] = tuple(DISTURBANCES),
    report: Report = lambda _: None,
    run: RunDisturbed | None = None,
) -> CaseBench[RefusableSummary]:
    """Get up from the same falls in disturbed worlds.

    Args:
        ways: Ways to compare.
        seed: Of the falls, the plans and what is random in a disturbance.
        each: Falls of each class.
        classes: Start classes.
        cases: Names of the disturbances.
        report: Called after each rise.
        run: Does the pieces in equal ways; None: one after another, here.
    """
    world, limit = ways.planner.world, ways.planner.torque_limit
    falls = sample_falls(world, dict.fromkeys(classes, each), np.random.default_rng(seed))
    pieces = {
        str(k): DisturbedPiece(number=k, fall=fall, seed=seed, cases=tuple(cases))
        for k, fall in enumerate(falls)
    }
    run = run or one_by_one(ways.measure)
    found = collect(pieces, run, lambda rises: [report(rise) for rise in rises])
    rises = [rise for group in found.values() for rise in group]
    return CaseBench(
        name="disturbed",
        seed=seed,
        n=len(falls),
        robot=world.robot.name,
        torque_limit_nm=limit.value,
        limit_by=limit.by,
        cases=RefusableSummary.table(rises, cases, ways.names),
        rises=rises,
    )


def select(robot: Robot, names: Sequence[str] = ()) -> tuple[str, ...]:
    """Select disturbances by name; no names for all.

    Raises:
        ValueError: if there is no disturbance of a name, or the robot lacks its joint.
    """
    for name in names:
        if name not in DISTURBANCES:
            raise ValueError(f"unknown case '{name}': expected {', '.join(DISTURBANCES)}")
    chosen = tuple(names or DISTURBANCES)
    for name in chosen:
        joint = DISTURBANCES[name].joint
        if joint not in (None, *robot.joint_names):
            raise ValueError(
                f"robot '{robot.name}' has no joint '{joint}': expected cases other than '{name}'"
            )
    return chosen


def _plan(planner: PlannedRise, fall: Fall, seed: list[int]) -> dict[str, Strategy]:
    """Plan a rise from a measured fall, to be played open loop and with feedback."""
    world, limit = planner.world, planner.torque_limit
    with Twin(world, turn_head(fall.posture)) as twin:
        start = estimate_posture(world, twin.read())
    rise = planner.plan(start, np.random.default_rng(seed))
    bare = replace(rise, balanced=False) if isinstance(rise, MotionPlan) else rise
    return {
        OPEN_LOOP: SamePlan(world=world, torque_limit=limit, rise=bare),
        FEEDBACK: SamePlan(world=world, torque_limit=limit, rise=rise),
    }
