"""Measures a robot: the whole benchmark, as one page with pictures."""

from __future__ import annotations

import hashlib
import math
import shlex
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from humanoid_getup.benchmarks.disturbed import DisturbedWays
from humanoid_getup.benchmarks.motions import MotionPiece, MotionSummary, measure_motion
from humanoid_getup.benchmarks.rise import MeasuredRise, RefusableSummary, rise_from
from humanoid_getup.benchmarks.whole import (
    CASES,
    QUICK_CASES,
    QUICK_SHARES,
    SHARES,
    CappedRise,
    DisturbedFall,
    Pictures,
    Whole,
    WholeBench,
    describe_conditions,
    make_caps,
    select_rises,
    summarize_rises,
)
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.output_files import staging
from humanoid_getup.commands.pieces import make_worker_request, starting
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import Versions
from humanoid_getup.jobs.requests.bench import (
    FIGURES,
    LEDGER,
    PAGE,
    PLOT,
    WHOLE_ARTEFACTS,
    BenchAll,
)
from humanoid_getup.motions.motion import MIRRORED_SUFFIX
from humanoid_getup.motions.motion_database import list_motions, load_database
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.reporting.benchmark_page import save_benchmark, write_page
from humanoid_getup.reporting.film_strip import AFTERMATH, NoRendererError, save_run
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import NEAREST, make_strategy
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from humanoid_getup.strategies.track_record import PLAN
from robots import FULL_TORQUE, Robot, TorqueLimit
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

Piece = CappedRise | MotionPiece | DisturbedFall
Result = MeasuredRise | MotionSummary | list[MeasuredRise]


def measure_robot(
    request: BenchAll, report: Report | None = None, cancel: Cancel | None = None
) -> WholeBench:
    """Run or resume the whole benchmark; write its page; return its figures.

    Raises:
        BadInputError: if robot or folder cannot be used, or the ledger is of another benchmark.
        CancelledError: if ``cancel`` ended it; what was finished is kept in the ledger.
    """
    BenchAll.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    with refusing():
        world = World(load_robot(request))
        whole = load_whole(request, world)
        ledger = _open_ledger(request, world)
        rises, motions, disturbed = _measure(request, whole, ledger, monitor)
    ways = whole.disturbed.names if whole.disturbed else ()
    together = [rise for some in disturbed.values() for rise in some]
    cases = summarize_rises(whole, rises)
    monitor.begin("drawing")
    with staging(request.out, WHOLE_ARTEFACTS) as folder:
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
            motions=motions,
            disturbed=RefusableSummary.table(together, whole.disturbances if ways else (), ways),
            notes=_list_notes(world.robot, whole),
            command=_write_command(request),
            conditions=describe_conditions(world, whole.caps[0].limit),
            pictures=pictures,
        )
        write_atomically(folder / FIGURES, to_json(result))
        write_atomically(folder / PAGE, write_page(result))
    return result


def load_whole(request: BenchAll, world: World, threads: int = 0) -> Whole:
    """Find what the robot can do with a number of threads; whatever it lacks is left out."""
    robot = world.robot
    database = load_database(robot) if list_motions(robot) else None
    own = [file.stem for file in list_policies(robot)] if robot.body.is_original else []

    def make(name: str, limit: TorqueLimit) -> Any:
        return make_strategy(world, name, torque_limit=limit, database=database, threads=threads)

    methods = [*((PLAN, NEAREST) if database else ()), *own]
    disturbed = None
    if database:
        options = PlannerOptions(threads=threads)
        disturbed = DisturbedWays(
            planner=PlannedRise(world, database, options=options),
            policies={name: make(name, FULL_TORQUE) for name in own},
        )
    motions = database.motions if database else ()
    return Whole(
        world=world,
        methods={name: partial(make, name) for name in methods},
        motions=[motion for motion in motions if not motion.name.endswith(MIRRORED_SUFFIX)],
        caps=make_caps(robot, request.limit_by, QUICK_SHARES if request.quick else SHARES),
        disturbed=disturbed,
        disturbances=QUICK_CASES if request.quick else CASES,
        seed=request.seed,
        each=request.each,
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
) -> tuple[dict[str, MeasuredRise], dict[str, MotionSummary], dict[str, list[MeasuredRise]]]:
    """Do all rises, motions and disturbed falls that the ledger does not hold yet."""
    rises, motions, disturbed = whole.list_rises(), whole.list_motions(), whole.list_disturbed()
    count = len(rises) + len(motions) + len(disturbed)
    if request.resume:
        monitor.tell(f"{len(ledger.done)} of {count} pieces are finished")
    advance = monitor.count("pieces", count)
    shared = make_worker_request(BenchAll, request, out=Path(), resume=False)
    with starting(request, count - len(ledger.done)) as executor:
        work = partial(do_piece, whole) if is_here(executor) else partial(do_piece_there, shared)

        def run(pieces: Mapping[str, Piece], kind: Any) -> dict[str, Any]:
            return do_pieces(
                work,
                pieces,
                executor,
                ledger=ledger,
                kind=kind,
                ended=lambda *_: advance(1),
                monitor=monitor,
                robot=shared.robot,
            )

        return (
            run(rises, MeasuredRise),
            run(motions, MotionSummary),
            run(disturbed, list[MeasuredRise]),
        )


def do_piece(whole: Whole, piece: Piece, threads: int = 0) -> Result:
    """Do a rise, a motion, or a disturbed fall."""
    if isinstance(piece, CappedRise):
        return whole.rise(piece)
    if isinstance(piece, MotionPiece):
        return measure_motion(whole.world, piece, threads=threads)
    return whole.disturb(piece)


def do_piece_there(request: BenchAll, piece: Piece) -> Result:
    """Do a piece in a worker."""
    return do_piece(_get_whole(request), piece, threads=1)


@lru_cache(maxsize=1)
def _get_whole(request: BenchAll) -> Whole:
    """Load the benchmark in a worker, once."""
    return load_whole(request, World(load_robot(request)), threads=1)


def _list_notes(robot: Robot, whole: Whole) -> list[str]:
    """List the parts that were not measured, with reasons."""
    notes = []
    if whole.disturbed is None:
        notes.append(
            f"Robot '{robot.name}' has no motions: nothing is planned or played, and no rise is "
            "disturbed. `getup motions retarget` transfers those of another robot."
        )
    if not set(whole.methods) - {PLAN, NEAREST}:
        other = "" if robot.body.is_original else " for this body"
        notes.append(f"Robot '{robot.name}' has no policies{other}: nothing learned is measured.")
    return notes


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
