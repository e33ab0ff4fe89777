"""The whole benchmark of a robot: same falls and judge for every method and torque cap."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from importlib.metadata import version

import msgspec
import mujoco
import numpy as np
from msgspec import UNSET, UnsetType

from humanoid_getup.benchmarks.rise import (
    MeasuredRise,
    RisePiece,
    list_pieces,
    measure_rise,
    summarize_classes,
)
from humanoid_getup.experiments.drop import FallError
from humanoid_getup.experiments.falls import CLASSES, Fall, sample_falls
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.motions.motion_database import list_motions, load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST, PLAN, make_strategy
from humanoid_getup.strategies.plan import Strategy
from robots import Robot, TorqueLimit
from robots.servo import LimitMode

# Of OP3's 4.1 N·m they are 3.0, 2.5 and 2.0 N·m, the limits of the other benchmarks.
SHARES = (1.0, 0.73, 0.61, 0.49)
QUICK_SHARES = (1.0, 0.61)


@dataclass(frozen=True, kw_only=True)
class TorqueCap:
    """A torque limit on every servo, as a share of the strongest one's stall torque."""

    share: float
    limit: TorqueLimit

    @property
    def name(self) -> str:
        """Return its name in tables."""
        return "stall torque" if self.limit.value is None else f"{self.share:.0%}"


def make_caps(
    robot: Robot, by: LimitMode | None = None, shares: tuple[float, ...] = SHARES
) -> list[TorqueCap]:
    """Make the caps of a robot, rounded to three digits."""
    stall = float(robot.max_torque.max())
    values = [None if share == 1.0 else float(f"{share * stall:.3g}") for share in shares]
    return [
        TorqueCap(share=share, limit=TorqueLimit(value, by).on(robot))
        for share, value in zip(shares, values, strict=True)
    ]


@dataclass(frozen=True, kw_only=True)
class FallsByClass:
    """Falls in the order of their classes, as many of each."""

    falls: list[Fall]
    classes: tuple[str, ...]
    missing: dict[str, str]
    """Classes in which the robot does not come to lie, and why they were left out."""


@dataclass(frozen=True, kw_only=True)
class CappedRise:
    """A rise by a method under a torque cap."""

    method: str
    cap: TorqueCap
    rise: RisePiece


class CapSummary(RiseSummary, frozen=True, kw_only=True):
    """The rises of a method under a cap, over all and by class."""

    method: str
    cap: str
    share_of_stall: float
    torque_limit_nm: float | None
    limit_by: LimitMode | None
    classes: dict[str, RiseSummary]


class Conditions(msgspec.Struct, frozen=True, kw_only=True):
    """Robot, servos, limit and programs, with which figures must be cited."""

    body: str
    mass_kg: float
    neck_height_m: float
    joints: int
    servos: dict[str, int]
    stall_torque_nm: float
    supply_v: float
    limit_by: LimitMode
    control_period_s: float
    scene: str
    humanoid_getup: str
    mujoco: str
    python: str


class Pictures(msgspec.Struct, frozen=True, kw_only=True):
    """Files with pictures of a benchmark."""

    plot: str | None = None
    strips: dict[str, str] = {}
    """Film strip of a rise of each class."""
    method: str | UnsetType = UNSET
    """Method whose rises are drawn."""
    reason: str = ""
    """Reason why there are no strips."""


class WholeBench(msgspec.Struct, frozen=True, kw_only=True):
    """The results of the whole benchmark."""

    name: str = "all"
    seed: int
    n: int
    robot: str
    body: str
    scene: str
    cases: dict[str, CapSummary]
    missing_classes: dict[str, str]
    notes: list[str]
    """What was not measured, with reasons."""
    command: str
    """Command line that repeats it."""
    conditions: Conditions
    pictures: Pictures = Pictures(reason="there is no rise to draw")


@dataclass(frozen=True, kw_only=True)
class Whole:
    """The whole benchmark of a robot: methods, caps and falls."""

    world: World
    methods: Mapping[str, Callable[[TorqueLimit], Strategy]]
    """Makers of strategies, by the names of the methods."""
    caps: Sequence[TorqueCap]
    seed: int
    each: int
    """Falls of each class."""

    @classmethod
    def load(
        cls,
        world: World,
        *,
        each: int,
        seed: int,
        limit_by: LimitMode | None = None,
        quick: bool = False,
        threads: int = 0,
    ) -> Whole:
        """Find what a robot can do; whatever it lacks is left out."""
        robot = world.robot
        database = load_database(robot) if list_motions(robot) else None
        own = [file.stem for file in list_policies(robot)] if robot.body.is_original else []

        def make(name: str, limit: TorqueLimit) -> Strategy:
            settings = PlannerSettings(torque_limit=limit, threads=threads)
            return make_strategy(world, name, settings, database=database)

        methods = [*((PLAN, NEAREST) if database else ()), *own]
        return cls(
            world=world,
            methods={name: partial(make, name) for name in methods},
            caps=make_caps(robot, limit_by, QUICK_SHARES if quick else SHARES),
            seed=seed,
            each=each,
        )

    def list_notes(self) -> list[str]:
        """List the parts that are not measured, with reasons."""
        notes, robot = [], self.world.robot
        if PLAN not in self.methods:
            notes.append(
                f"Robot '{robot.name}' has no motions: nothing is planned or played. `getup "
                "motions discover` finds some."
            )
        if not set(self.methods) - {PLAN, NEAREST}:
            other = "" if robot.body.is_original else " for this body"
            notes.append(
                f"Robot '{robot.name}' has no policies{other}: nothing learned is measured."
            )
        return notes

    @cached_property
    def falls(self) -> FallsByClass:
        """Sample the falls that all methods get."""
        return sample_by_class(self.world, self.each, self.seed)

    def list_rises(self) -> dict[str, CappedRise]:
        """List the rises of all methods under all caps."""
        return {
            f"{method}, {cap.name}: {number}": CappedRise(method=method, cap=cap, rise=piece)
            for cap in self.caps
            for method in self.methods
            for number, piece in list_pieces(
                self.falls.falls,
                self.seed,
                classes=self.falls.classes,
                preflight=method != NEAREST,
            ).items()
        }

    @cached_property
    def make(self) -> Callable[[str, TorqueLimit], Strategy]:
        """Return what makes the strategy of a method under a limit, once."""
        return cache(lambda method, limit: self.methods[method](limit))

    def do(self, piece: CappedRise) -> MeasuredRise:
        """Do a rise."""
        return measure_rise(self.make(piece.method, piece.cap.limit), piece.rise)


def sample_by_class(world: World, each: int, seed: int) -> FallsByClass:
    """Sample equally many falls of each class; skip classes in which the robot never lies."""
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


def select_rises(
    rises: Mapping[str, MeasuredRise], method: str, cap: TorqueCap
) -> list[MeasuredRise]:
    """Select the rises of a method under a cap, in the order of their falls."""
    return [rise for name, rise in rises.items() if name.startswith(f"{method}, {cap.name}: ")]


def summarize_rises(whole: Whole, rises: Mapping[str, MeasuredRise]) -> dict[str, CapSummary]:
    """Summarize the rises of each method under each cap."""
    found = dict[str, CapSummary]()
    for cap in whole.caps:
        for method in whole.methods:
            ours = select_rises(rises, method, cap)
            found[f"{method}, {cap.name}"] = CapSummary.of(
                ours,
                method=method,
                cap=cap.name,
                share_of_stall=cap.share,
                torque_limit_nm=cap.limit.value,
                limit_by=cap.limit.by,
                classes=summarize_classes(ours, whole.falls.classes),
            )
    return found


def describe_conditions(world: World, limit: TorqueLimit) -> Conditions:
    """Describe robot, servos, limit and programs."""
    robot = world.robot
    torso = robot.layout(world.model).torso
    servos = Counter(joint.servo.model.name for joint in robot.joints)
    return Conditions(
        body=str(robot.body),
        mass_kg=float(world.model.body_subtreemass[torso]),
        neck_height_m=robot.standing_neck_height,
        joints=robot.n,
        servos=dict(servos.most_common()),
        stall_torque_nm=float(robot.max_torque.max()),
        supply_v=robot.supply_voltage,
        limit_by=limit.mode,
        control_period_s=robot.control_period,
        scene=world.scene.name,
        humanoid_getup=version("humanoid-getup"),
        mujoco=mujoco.__version__,
        python=platform.python_version(),
    )
