"""`getup bench rise`: rises from many settled falls, by plans."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from tyro.conf import arg

from humanoid_getup.benchmarks.rise import (
    BENCH_CLASSES,
    MeasuredRise,
    RiseBench,
    RisePiece,
    list_pieces,
    measure_rise,
    summarize_classes,
)
from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import format_figure, make_table
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.files import WRITTEN
from humanoid_getup.commands.inputs import load_world, make_settings
from humanoid_getup.commands.options import (
    Count,
    EngineOptions,
    LoadOption,
    PlannerOptions,
    SceneOptions,
)
from humanoid_getup.commands.pieces import make_worker_request, starting
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import Versions, checked
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.judging.summary import RiseSummary
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.strategies.planned_rise import PlannedRise

HEADINGS = {
    "n": "n",
    "planned": "planned",
    "stood": "stood",
    "stood_interval_95": "95 %",
    "stand_time_s": "stand [s]",
    "peak_torque_nm": "peak [N·m]",
    "rms_torque_nm": "RMS [N·m]",
    "torque_use": "of limit",
    "head_impact_m_s": "head [m/s]",
    "self_collisions": "self-collisions",
}
"""Figures of the tables, with their headings."""
LOADS = ("stand_time_s", "peak_torque_nm", "rms_torque_nm")


@dataclass(frozen=True, kw_only=True)
class BenchRise(EngineOptions, PlannerOptions, LoadOption, SceneOptions):
    """Rise from many settled falls: success rates, times and faults."""

    n: Count = 20
    """Falls of each class: supine, prone, lateral."""
    ledger: Annotated[Path | None, WRITTEN, arg(metavar="FILE")] = None
    """File in which every finished rise is kept, for work of hours: --resume continues with it,
    without --resume an earlier ledger is replaced."""
    resume: bool = False
    """Keep the finished rises of the ledger; they must be of the same benchmark."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.resume and self.ledger is None:
            yield "--resume is given without --ledger, expected the file of the rises"


@command(
    "bench rise", json=True, is_begun=lambda request: request.ledger and request.ledger.exists()
)
def benchmark(request: BenchRise, monitor: ProgressMonitor) -> RiseBench:
    """Rise from many settled falls; finished rises are kept in the ledger."""
    monitor.begin("loading")
    planner = make_planner(request)
    world = planner.world
    conditions: dict[str, Any] = {
        "seed": request.seed,
        "versions": Versions.find(request.robot),
        **planner.settings.describe(),
    }
    with refusing():
        ledger = None
        if request.ledger is not None:
            world_hash = hashlib.sha256(world.content).hexdigest()
            start = Ledger.resume if request.resume else Ledger
            ledger = start(request.ledger, {"world": world_hash, "n": request.n, **conditions})
        rng = np.random.default_rng(request.seed)
        falls = sample_falls(world, dict.fromkeys(BENCH_CLASSES, request.n), rng)
    # An unfiltered path is played to see whether it stands.
    pieces = list_pieces(falls, request.seed, preflight=request.filtering)
    if ledger is not None and ledger.done:
        monitor.tell(f"{len(ledger.done)} rises are finished")
    advance = monitor.count("rises", len(pieces))
    shared = make_worker_request(BenchRise, request, ledger=None, resume=False)
    left = len(pieces.keys() - (ledger.done.keys() if ledger else ()))
    with refusing(), starting(request, left) as executor:
        work = partial(measure_rise, planner) if is_here(executor) else partial(plan_rise, shared)
        found = do_pieces(
            checked(work, executor, shared.robot),
            pieces,
            executor,
            ledger=ledger,
            kind=MeasuredRise,
            ended=lambda *_: advance(1),
            monitor=monitor,
        )
    rises = [*found.values()]
    return RiseBench(
        n=len(rises),
        robot=world.robot.name,
        body=str(world.robot.body),
        load=world.robot.load or None,
        scene=world.scene.name,
        classes=summarize_classes(rises, BENCH_CLASSES),
        all=RiseSummary.of(rises),
        rises=rises,
        **conditions,
    )


@benchmark.show
def _print(found: RiseBench, _: BenchRise, console: Console) -> None:
    figures = ("n", "planned", "stood", "stood_interval_95", *LOADS, "self_collisions")
    print_figures("rise", found.classes, figures, console)


def print_figures(
    name: str, cases: Mapping[str, Any], figures: Sequence[str], console: Console
) -> None:
    """Print figures of cases as a table."""
    table = make_table((name, *(HEADINGS[figure] for figure in figures)), left=(name,))
    for case, summary in cases.items():
        table.add_row(escape(case), *(format_figure(getattr(summary, key)) for key in figures))
    console.print(table)


def make_planner(request: BenchRise, threads: int = 0) -> PlannedRise:
    """Make the planner of a benchmark, whose physics takes a number of threads."""
    world = load_world(request)
    with refusing():
        return PlannedRise(world, settings=make_settings(request, world.robot, threads=threads))


def plan_rise(request: BenchRise, piece: RisePiece) -> MeasuredRise:
    """Plan a rise and play it on the twin, in a worker."""
    return measure_rise(_get_planner(request), piece)


_get_planner = lru_cache(maxsize=1)(partial(make_planner, threads=1))
