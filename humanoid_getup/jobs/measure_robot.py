"""Measures a robot: the whole benchmark, as one page with pictures."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

from msgspec.structs import replace

from humanoid_getup.benchmarks.part import MethodRises, Part, PartResult
from humanoid_getup.benchmarks.rise_method import find_policies, list_methods
from humanoid_getup.benchmarks.torque_cap import QUICK_SHARES, SHARES, make_caps
from humanoid_getup.benchmarks.whole import (
    CASES,
    QUICK_CASES,
    Pictures,
    Whole,
    WholeBench,
    name_rises,
    summarize_parts,
)
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.jobs.pieces.spreading import make_worker_request
from humanoid_getup.jobs.requests.bench import (
    FIGURES,
    PAGE,
    PARTS,
    PLOT,
    WHOLE_ARTEFACTS,
    BenchAll,
)
from humanoid_getup.jobs.run_parts import PartWork, Results, run_parts
from humanoid_getup.motions.motion import MIRRORED_SUFFIX
from humanoid_getup.motions.motion_database import list_motions, load_database
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.benchmark_page import write_page
from humanoid_getup.reporting.benchmark_plot import save_benchmark
from humanoid_getup.reporting.film_strip import AFTERMATH, NoRendererError, save_run
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from robots import Robot
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically


def measure_robot(
    request: BenchAll, report: Report | None = None, cancel: Cancel | None = None
) -> WholeBench:
    """Run or resume the whole benchmark; write its page; return its figures.

    Raises:
        BadInputError: if robot or folder cannot be used, or finished parts are of another one.
        CancelledError: if ``cancel`` ended it; the parts that were finished are kept.
    """
    BenchAll.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    with refusing():
        world = World(load_robot(request))
        whole = _load_whole(request, world)
    shared = make_worker_request(BenchAll, request, out=Path(), resume=False)
    results = run_parts(
        whole.parts(),
        request.out / PARTS,
        monitor,
        resume=request.resume,
        away=PartWork(request=request, work=partial(measure_part, shared), robot=shared.robot),
    )
    notes = _list_notes(world.robot, whole)
    result = summarize_parts(whole, results, notes=notes, command=_write_command(request))
    monitor.begin("drawing")
    with staging(request.out, WHOLE_ARTEFACTS) as folder:
        pictures = _draw(whole, results, result, folder, monitor.begin)
        result = replace(result, body=str(world.robot.body), pictures=pictures)
        write_atomically(folder / FIGURES, to_json(result))
        write_atomically(folder / PAGE, write_page(result))
    return result


def measure_part(request: BenchAll, name: str) -> PartResult:
    """Measure a part of the benchmark by its name, in a worker."""
    return _load_parts(request)[name].run(lambda _: None)


@lru_cache(maxsize=1)
def _load_parts(request: BenchAll) -> dict[str, Part]:
    """Load the parts of a benchmark, in a worker, once."""
    whole = _load_whole(request, World(load_robot(request)), threads=1)
    return {part.name: part for part in whole.parts()}


def _load_whole(request: BenchAll, world: World, threads: int = 0) -> Whole:
    """Find what the robot can do with a number of threads; whatever it lacks is left out."""
    robot = world.robot
    caps = make_caps(robot, request.limit_by, QUICK_SHARES if request.quick else SHARES)
    database = load_database(robot) if list_motions(robot) else None
    policies = find_policies(robot)
    full = caps[0].limit
    own = database.motions if database else ()
    return Whole(
        world=world,
        methods=list(list_methods(world, database, policies, threads=threads)),
        motions=[motion for motion in own if not motion.name.endswith(MIRRORED_SUFFIX)],
        caps=caps,
        planner=PlannedRise(
            world, database, torque_limit=full, options=PlannerOptions(threads=threads)
        )
        if database
        else None,
        policies={
            name: make_strategy(world, name, torque_limit=full, threads=threads)
            for name in policies
        },
        disturbances=QUICK_CASES if request.quick else CASES,
        seed=request.seed,
        each=request.each,
        threads=threads,
    )


def _list_notes(robot: Robot, whole: Whole) -> list[str]:
    """List the parts that were not measured, with reasons."""
    notes = []
    if whole.planner is None:
        notes.append(
            f"Robot '{robot.name}' has no motions: nothing is planned or played, and no rise is "
            "disturbed. `getup motions retarget` transfers those of another robot."
        )
    if not whole.policies:
        other = "" if robot.body.is_original else " for this body"
        notes.append(f"Robot '{robot.name}' has no policies{other}: nothing learned is measured.")
    return notes


def _draw(
    whole: Whole, results: Results, result: WholeBench, folder: Path, report: Callable[[str], None]
) -> Pictures:
    """Draw the plot and a rise of each class; return the files, or the reason for none."""
    if not whole.methods:
        return result.pictures
    save_benchmark(list(result.cases.values()), folder / PLOT)
    method, cap = whole.methods[0], whole.caps[0]
    strips: dict[str, str] = {}
    reason = ""
    rises = results[name_rises(method.name, cap)]
    chosen = _choose_rises(rises) if isinstance(rises, MethodRises) else {}
    for name, number in chosen.items():
        report(f"drawing a {name} rise")
        try:
            file = f"strip_{name}.png"
            rise = whole.repeat(method, number)
            if rise.outcome is not None:
                title = f"{whole.world.robot.name}, {name} fall: {rise.plan.label}"
                end = float(rise.outcome.stand.start_time) + AFTERMATH if rise.stood else math.inf
                rows = end / whole.world.robot.control_period
                qpos, robot = rise.outcome.qpos, whole.world.robot
                save_run(robot, whole.world.model, qpos, rows, folder / file, title=title)
                strips[name] = file
        except NoRendererError as error:
            reason = str(error)
            break
    return Pictures(plot=PLOT, strips=strips, method=method.name, reason=reason)


def _choose_rises(result: MethodRises) -> dict[str, int]:
    """Choose the first rise of each class that stood, or else the first; by its number."""
    rises = result.rises
    chosen = {}
    for name in result.classes:
        numbers = [k for k, rise in enumerate(rises) if rise.bench_class == name]
        chosen[name] = next((k for k in numbers if rises[k].stood), numbers[0])
    return chosen


def _write_command(request: BenchAll) -> str:
    """Write the command line that repeats the benchmark."""
    words = ["getup", "bench", "all", "--robot", request.robot, "--n", str(request.each)]
    words += ["--seed", str(request.seed)]
    words += ["--body", request.body] if request.body else []
    words += ["--limit-by", request.limit_by] if request.limit_by else []
    words += ["--quick"] if request.quick else []
    return shlex.join(words)
