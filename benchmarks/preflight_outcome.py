"""Compare what the preflight says of planned rises with how they end when they are played.

Robots fall, settle, are measured, and a rise is planned and judged as on a robot. Then it is
played whatever the verdict is. Two verdicts are wrong: a rise is refused though it stands, or
passed though it falls.

With `--meshes`, the robot that falls and rises also has the shapes of a mesh model of the OP3
(see mesh_robot.py), while plan and preflight know only the shapes of the package: as on a real
robot, whose shapes the package knows only roughly.

    python benchmarks/preflight_outcome.py --meshes FOLDER --n 200 --seed 21 --json outcome.json
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from mesh_robot import with_meshes
from rich.console import Console
from rich.table import Table

from drivers import State, Twin
from humanoid_getup.cli.shared.console import counting
from humanoid_getup.execution.get_up import get_up
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, sample_falls
from humanoid_getup.playback.preflight import MotionVerdict, Verdict
from humanoid_getup.playback.supervisor import Supervisor
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RisePlan, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, TorqueLimit, load_robot
from robots.servo import LimitMode
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

OWN, MESHES = "own shapes", "mesh shapes"


@dataclass(frozen=True)
class UnheededVerdict(Verdict):
    """A verdict that is kept but does not stop the rise."""

    given: Verdict | None = None
    """None where nothing was planned."""
    is_last: bool = True
    """Whether nothing else is judged in its place; then the rise is played."""

    @property
    def passed(self) -> bool:
        """Return whether the rise is played as it is."""
        return self.is_last or (self.given is not None and self.given.passed)


@dataclass(frozen=True, kw_only=True)
class PlayedPlan(RisePlan):
    """A plan that is played whatever its preflight says.

    It is played open loop where it is refused with feedback, and judged as it is played.
    """

    plan: RisePlan

    def controller(self, strategy: Strategy) -> Supervisor | None:
        """Make the controller of the plan."""
        return self.plan.controller(strategy)

    def preflight(
        self, strategy: Strategy, settled: State, measure: Callable[[], Posture]
    ) -> UnheededVerdict:
        """Keep the plan's verdict."""
        given = self.plan.preflight(strategy, settled, measure)
        return UnheededVerdict(given=given, is_last=self.plan.open_loop() is None)

    def open_loop(self) -> PlayedPlan | None:
        """Return the plan without feedback, which is judged where it is refused with it."""
        other = self.plan.open_loop()
        return None if other is None else replace(self, plan=other)


class PlayAnyway:
    """A strategy whose plans are played whatever their preflight says."""

    def __init__(self, strategy: Strategy) -> None:
        self._strategy = strategy
        self.world, self.torque_limit = strategy.world, strategy.torque_limit

    def plan(self, start: Posture, rng: np.random.Generator) -> PlayedPlan:
        """Plan as the other strategy does."""
        plan = self._strategy.plan(start, rng)
        return PlayedPlan(status=plan.status, plan=plan)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A planned rise: its verdict, and how it ended."""

    start_class: str
    planned: bool
    """False where no plan was found; then nothing was judged or played."""
    refusals: tuple[str, ...] = ()
    stood: bool = False
    start_overlap: float = 0.0
    """[m]"""
    overlap_growth: float = 0.0
    """[m]"""

    @property
    def refused(self) -> bool:
        """Return whether the preflight refused it."""
        return bool(self.refusals)


def rise(body: World, strategy: Strategy, fall: Fall, seed: list[int]) -> Outcome:
    """Let a body that fell rise by a strategy, and keep the verdict and the end."""
    rng = np.random.default_rng(seed)
    result = get_up(Twin(body, fall.posture), PlayAnyway(strategy), seed=rng, max_attempts=1)
    verdict = result.attempts[0].verdict if result.attempts else None
    given = verdict.given if isinstance(verdict, UnheededVerdict) else None
    if not isinstance(given, MotionVerdict):
        return Outcome(start_class=fall.start_class, planned=False)
    return Outcome(
        start_class=fall.start_class,
        planned=True,
        refusals=tuple(map(str, given.refusals)),
        stood=result.stood,
        start_overlap=given.figures.start_overlap,
        overlap_growth=given.figures.overlap_growth,
    )


def summarize(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Count verdicts and ends of the rises that were planned."""
    judged = [outcome for outcome in outcomes if outcome.planned]
    wrong = {
        "refused_though_it_stands": sum(o.refused and o.stood for o in judged),
        "passed_though_it_falls": sum(not o.refused and not o.stood for o in judged),
    }
    why = Counter(_kind(text) for o in judged if o.stood for text in o.refusals)
    return {
        "n": len(outcomes),
        "planned": len(judged),
        "refused": sum(o.refused for o in judged),
        "stood": sum(o.stood for o in judged),
        **wrong,
        **{f"{name}_95": wilson_interval(k, len(judged)) for name, k in wrong.items() if judged},
        "refusals_of_those_that_stood": dict(why),
    }


def _kind(text: str) -> str:
    """Return the kind of a refusal, without joints and numbers."""
    kinds = ("into itself", "inside itself", "all the torque", "held stand", "targets move")
    return next((kind for kind in kinds if kind in text), text)


def compare(
    bodies: dict[str, World],
    strategy: Strategy,
    *,
    seed: int,
    each: int,
    report: Callable[[Outcome], None] = lambda _: None,
) -> dict[str, Any]:
    """Compare verdicts and ends of rises of each body from ``each`` falls of every class."""
    cases = {}
    for name, body in bodies.items():
        falls = sample_falls(body, dict.fromkeys(CLASSES, each), np.random.default_rng(seed))
        outcomes = []
        for number, fall in enumerate(falls):
            outcomes.append(rise(body, strategy, fall, [seed, 1, number]))
            report(outcomes[-1])
        cases[name] = summarize(outcomes) | {"rises": [asdict(o) for o in outcomes]}
    return {
        "name": "preflight_outcome",
        "seed": seed,
        "n": each * len(CLASSES),
        "torque_limit_nm": strategy.torque_limit.value,
        "limit_by": strategy.torque_limit.by,
        "cases": cases,
    }


def print_table(result: dict[str, Any]) -> None:
    """Print the counts of each body."""
    heads = ("planned", "refused", "stood", "refused, stands", "passed, falls")
    table = Table("falls and rises with", *heads, box=None, header_style="bold")
    keys = ("planned", "refused", "stood", "refused_though_it_stands", "passed_though_it_falls")
    for name, case in result["cases"].items():
        table.add_row(name, *(str(case[key]) for key in keys))
    Console(width=120).print(table)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Compare verdicts of the preflight with how the rises end."""

    meshes: Path | None = None
    """Folder of the mesh model; without it only the package's own shapes are tried."""
    n: int = 200
    """Falls of each body, a quarter of each class."""
    seed: int = 21
    robot: str = "op3"
    torque_limit: float | None = None
    """Of every servo [N·m]; none for all the torque it has."""
    limit_by: LimitMode | None = None
    """What the limit acts on; none for the robot's own."""
    json: Path | None = None
    """Where figures are written."""


def main(options: Options) -> None:
    """Measure, print, write."""
    robot = load_robot(options.robot)
    bodies = {OWN: World(robot)}
    if options.meshes is not None:
        bodies[MESHES] = World(with_meshes(robot, options.meshes))
    limit = TorqueLimit(options.torque_limit, options.limit_by)
    each = options.n // len(CLASSES)
    with counting("rises", len(bodies) * each * len(CLASSES)) as count:
        result = compare(
            bodies,
            PlannedRise(World(robot), torque_limit=limit),
            seed=options.seed,
            each=each,
            report=lambda _: count(1),
        )
    print_table(result)
    if options.json is not None:
        write_atomically(options.json, to_json(result))


if __name__ == "__main__":
    main(tyro.cli(Options))
