"""`getup bench all`: measure a robot as one page with pictures."""

from __future__ import annotations

import hashlib
import math
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, Literal

from rich.console import Console
from tyro.conf import arg

from humanoid_getup.benchmarks.rise import MeasuredRise, rise_from
from humanoid_getup.benchmarks.whole import (
    CappedRise,
    Pictures,
    Whole,
    WholeBench,
    describe_conditions,
    select_rises,
    summarize_rises,
)
from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.files import Written, staging
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.look.bench_rise import LOADS, print_figures
from humanoid_getup.commands.options import BodyOption, EngineOptions, RobotOption, Seed
from humanoid_getup.commands.pieces import make_worker_request, starting
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import Versions, checked
from humanoid_getup.experiments.falls import CLASSES
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.reporting.benchmark_page import save_benchmark, write_page
from humanoid_getup.reporting.film_strip import AFTERMATH, NoRendererError, save_run
from humanoid_getup.simulation.world import World
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically
from robots.storage.validation import at_least

PAGE, FIGURES, PLOT = "benchmark.md", "benchmark.json", "benchmark.png"
LEDGER = "benchmark.jsonl"
STRIPS = tuple(f"strip_{name}.png" for name in CLASSES)
FILES = (PAGE, FIGURES, PLOT, *STRIPS)


@dataclass(frozen=True, kw_only=True)
class BenchAll(EngineOptions, BodyOption, RobotOption):
    """Measure a robot as one page: every method under several torque caps, from the same falls."""

    n: Annotated[int | None, at_least(1)] = None
    """Falls of each class: supine, prone, left, right; default: 20, with --quick 4."""
    seed: Seed = 0
    limit_by: Literal["current", "pwm", "ideal"] | None = None
    """What the torque caps act on; default: the robot's own."""
    quick: bool = False
    """Fewer falls and torque caps, for a first look."""
    out: Annotated[Path, Written(FILES), arg(metavar="DIR")] = Path("out/benchmark")
    """Folder for benchmark.md, benchmark.json, pictures, and the ledger of what is finished."""
    resume: bool = False
    """Keep what is finished; it must be of the same benchmark."""

    @property
    def each(self) -> int:
        """Return the falls of each class."""
        return self.n if self.n is not None else 4 if self.quick else 20


@command("bench all", json=True, is_begun=lambda request: (request.out / LEDGER).exists())
def measure_robot(request: BenchAll, monitor: ProgressMonitor) -> WholeBench:
    """Run or resume the whole benchmark; write its page; return its figures."""
    monitor.begin("loading")
    with refusing():
        world = World(load_robot(request))
        whole = _load_whole(request, world)
        ledger = _open_ledger(request, world)
        rises = _measure(request, whole, ledger, monitor)
    cases = summarize_rises(whole, rises)
    monitor.begin("drawing")
    with staging(request.out, FILES) as folder:
        pictures = Pictures(reason="there is no rise to draw")
        if rises:
            save_benchmark(list(cases.values()), folder / PLOT)
            pictures = _draw(whole, rises, folder, monitor.begin)
        result = WholeBench(
            seed=request.seed,
            n=request.each,
            robot=world.robot.name,
            body=str(world.robot.body),
            scene=world.scene.name,
            cases=cases,
            missing_classes=whole.falls.missing if rises else {},
            notes=whole.list_notes(),
            command=_write_command(request),
            conditions=describe_conditions(world, whole.caps[0].limit),
            pictures=pictures,
        )
        write_atomically(folder / FIGURES, to_json(result))
        write_atomically(folder / PAGE, write_page(result))
    return result


@measure_robot.show
def _print(found: WholeBench, request: BenchAll, console: Console) -> None:
    figures = ("n", "stood", "stood_interval_95", *LOADS, "torque_use", "head_impact_m_s")
    print_figures("all", found.cases, figures, console)
    console.print(f"written to {request.out / PAGE}", markup=False)


def _load_whole(request: BenchAll, world: World, threads: int = 0) -> Whole:
    """Find what the robot can do with a number of threads."""
    return Whole.load(
        world,
        each=request.each,
        seed=request.seed,
        limit_by=request.limit_by,
        quick=request.quick,
        threads=threads,
    )


def _open_ledger(request: BenchAll, world: World) -> Ledger:
    """Open the ledger of finished pieces, or begin one."""
    recipe = {
        "world": hashlib.sha256(world.content).hexdigest(),
        "limit_by": request.limit_by,
        "quick": request.quick,
        "seed": request.seed,
        "n": request.each,
        "versions": Versions.find(request.robot),
    }
    start = Ledger.resume if request.resume else Ledger
    return start(request.out / LEDGER, recipe)


def _measure(
    request: BenchAll, whole: Whole, ledger: Ledger, monitor: ProgressMonitor
) -> dict[str, MeasuredRise]:
    """Do all rises that the ledger does not hold yet."""
    rises = whole.list_rises()
    if request.resume:
        monitor.tell(f"{len(ledger.done)} of {len(rises)} rises are finished")
    advance = monitor.count("rises", len(rises))
    shared = make_worker_request(BenchAll, request, out=Path(), resume=False)
    with starting(request, len(rises) - len(ledger.done)) as executor:
        work = whole.do if is_here(executor) else partial(do_piece_there, shared)
        return do_pieces(
            checked(work, executor, shared.robot),
            rises,
            executor,
            ledger=ledger,
            kind=MeasuredRise,
            ended=lambda *_: advance(1),
            monitor=monitor,
        )


def do_piece_there(request: BenchAll, piece: CappedRise) -> MeasuredRise:
    """Do a rise in a worker."""
    return _get_whole(request).do(piece)


@lru_cache(maxsize=1)
def _get_whole(request: BenchAll) -> Whole:
    """Load the benchmark in a worker, once."""
    return _load_whole(request, World(load_robot(request)), threads=1)


def _draw(
    whole: Whole,
    rises: Mapping[str, MeasuredRise],
    folder: Path,
    report: Callable[[str], None],
) -> Pictures:
    """Draw a rise of each class, the first that stood or else the first; name the files."""
    robot, cap, method = whole.world.robot, whole.caps[0], next(iter(whole.methods))
    ours = select_rises(rises, method, cap)
    pieces = [piece for piece in whole.list_rises().values() if piece.method == method]
    strips: dict[str, str] = {}
    for side in whole.falls.classes:
        numbers = [k for k, rise in enumerate(ours) if rise.bench_class == side]
        number = next((k for k in numbers if ours[k].stood), numbers[0])
        report(f"drawing a {side} rise")
        rise = rise_from(whole.make(method, cap.limit), pieces[number].rise)
        if rise.outcome is None:
            continue
        file, title = f"strip_{side}.png", f"{robot.name}, {side} fall: {rise.plan.label}"
        end = float(rise.outcome.stand.start_time) + AFTERMATH if rise.stood else math.inf
        rows, qpos = end / robot.control_period, rise.outcome.qpos
        try:
            save_run(robot, whole.world.model, qpos, rows, folder / file, title=title)
        except NoRendererError as error:
            return Pictures(plot=PLOT, strips=strips, method=method, reason=str(error))
        strips[side] = file
    return Pictures(plot=PLOT, strips=strips, method=method)


def _write_command(request: BenchAll) -> str:
    """Write the command line that repeats the benchmark."""
    words = ["getup", "bench", "all", "--robot", request.robot, "--n", str(request.each)]
    words += ["--seed", str(request.seed)]
    words += ["--body", request.body] if request.body else []
    words += ["--limit-by", request.limit_by] if request.limit_by else []
    words += ["--quick"] if request.quick else []
    return shlex.join(words)
