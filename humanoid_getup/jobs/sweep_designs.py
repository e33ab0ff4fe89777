"""Sweeps over designs: gets up with each, and writes where a design stops getting up."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

from msgspec import convert

from humanoid_getup.benchmarks.sweep.design import (
    Design,
    build_robot,
    build_world,
    limit_torque,
    list_designs,
)
from humanoid_getup.benchmarks.sweep.swept_design import (
    Sweep,
    SweptClass,
    SweptDesign,
    list_axes,
    measure_class,
)
from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import Versions
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.starts.falls import CLASSES
from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.jobs.pieces.spreading import make_worker_request, starting
from humanoid_getup.jobs.policies import load_policy
from humanoid_getup.jobs.requests.command_text import write_command
from humanoid_getup.jobs.requests.sweep import (
    SWEEP_ARTEFACTS,
    SWEEP_FIGURES,
    SWEEP_LEDGER,
    SWEEP_PAGE,
    SWEEP_PLOT,
    SweepRequest,
)
from humanoid_getup.policy.onnx_policy import find_policy
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.reporting.sweep_page import write_sweep_page
from humanoid_getup.reporting.sweep_plot import save_sweep
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.strategies.choice import NEAREST, STRAIGHT, make_strategy
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from humanoid_getup.strategies.track_record import PLAN
from robots import Robot
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

Piece = tuple[Design, LyingSide]
"""A design, and a class of falls."""


def sweep(
    request: SweepRequest, report: Report | None = None, cancel: Cancel | None = None
) -> Sweep:
    """Get up with every design of a request; write the page, the figures and the plot.

    Raises:
        BadInputError: if a design cannot be built, or the ledger is of another sweep.
        CancelledError: if ``cancel`` ended it; what was finished is kept in the ledger.
    """
    SweepRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    designs = list_designs(
        request.bodies,
        request.servos or ("",),
        request.torque_limits,
        request.scenes,
        request.ways,
    )
    monitor.begin("loading")
    check_designs(request, designs, monitor)
    designs = [replace(each, digest=hash_files(request, each)) for each in designs]
    found = _measure_all(request, designs, monitor)
    result = _summarize(request, designs, found)
    with staging(request.out, SWEEP_ARTEFACTS) as folder:
        save_sweep(result, folder / SWEEP_PLOT)
        write_atomically(folder / SWEEP_FIGURES, to_json(result))
        write_atomically(folder / SWEEP_PAGE, write_sweep_page(result))
    return result


def is_begun(request: SweepRequest) -> bool:
    """Return whether there is a sweep to resume."""
    return (request.out / SWEEP_LEDGER).exists()


def check_designs(
    request: SweepRequest, designs: Sequence[Design], monitor: ProgressMonitor
) -> None:
    """Build the robot of every design, and load every scene and policy.

    Raises:
        BadInputError: naming each that cannot be had.
    """
    load_robot(request)
    problems = list[str]()
    for (_body, _servo), some in _group(designs).items():
        monitor.check()
        try:
            with refusing():
                _check_robot(request, build_robot(request.robot, some[0]), some)
        except BadInputError as error:
            problems += error.problems
    if problems:
        raise BadInputError(*dict.fromkeys(problems))


def _group(designs: Sequence[Design]) -> dict[tuple[str, str], list[Design]]:
    """Group designs by their robot."""
    found = dict[tuple[str, str], list[Design]]()
    for design in designs:
        found.setdefault((design.body, design.servo), []).append(design)
    return found


def _check_robot(request: SweepRequest, robot: Robot, designs: Sequence[Design]) -> None:
    """Check what the designs of one robot need besides it.

    Raises:
        ValueError: if a torque limit, scene or policy cannot be had.
    """
    for limit in {design.torque_limit: design for design in designs}.values():
        limit_torque(limit, request.limit_by, robot)
    for scene in dict.fromkeys(design.scene for design in designs):
        load_scene(scene, robot, request.seed)
    for way in dict.fromkeys(design.way for design in designs):
        if way not in (PLAN, NEAREST, STRAIGHT):
            load_policy(robot, way, None)


def hash_files(request: SweepRequest, design: Design) -> str:
    """Compute a checksum of the scene's file and the policy's; "" where names say all."""
    files = [Path(name) for name in (design.scene, design.way) if Path(name).is_file()]
    if design.way not in (PLAN, NEAREST, STRAIGHT):
        files.append(find_policy(load_robot(request), design.way))
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files))
    return digest.hexdigest()[:16] if files else ""


def _measure_all(
    request: SweepRequest, designs: Sequence[Design], monitor: ProgressMonitor
) -> dict[str, SweptClass]:
    """Measure the classes of all designs that a ledger does not hold yet."""
    shared = make_worker_request(SweepRequest, request, out=Path(), resume=False)
    recipe = {
        "versions": Versions.find(request.robot),
        "seed": request.seed,
        "n": request.n,
        "search_budget": request.search_budget,
        "limit_by": request.limit_by,
    }
    path = request.out / SWEEP_LEDGER
    with refusing():
        ledger = Ledger.resume(path, recipe) if request.resume else Ledger(path, recipe)
    pieces: dict[str, Piece] = {
        name_part(design, side): (design, side) for design in designs for side in CLASSES
    }
    left = {name: piece for name, piece in pieces.items() if name not in ledger.done}
    if request.resume:
        monitor.tell(f"{len(pieces) - len(left)} of {len(pieces)} classes are finished")
    advance = monitor.count("classes", len(left))

    def end(name: str, found: SweptClass) -> None:
        ledger.add(name, found)
        advance(1)

    with refusing(), starting(request, len(left)) as executor:
        work = partial(measure_piece, shared, 0 if is_here(executor) else 1)
        do_pieces(work, left, executor, ended=end, monitor=monitor, robot=shared.robot)
    _make_strategy.cache_clear()  # the robot may change before this process sweeps again
    return {name: convert(ledger.done[name], SweptClass) for name in pieces}


def name_part(design: Design, side: LyingSide) -> str:
    """Name the rises of a design from a side, as the ledger does."""
    content = f" ({design.digest})" if design.digest else ""
    return f"{design.name}: {side}{content}"


def measure_piece(request: SweepRequest, threads: int, piece: Piece) -> SweptClass:
    """Measure a class of a design, in a worker."""
    design, side = piece
    strategy = _make_strategy(request, threads, design)
    preflight = design.way not in (NEAREST, STRAIGHT)
    return measure_class(strategy, side, request.seed, request.n, preflight=preflight)


@lru_cache(maxsize=1)
def _make_strategy(request: SweepRequest, threads: int, design: Design) -> Strategy:
    """Make the strategy of a design; the pieces of one follow each other."""
    world = build_world(request.robot, design, request.seed)
    limit = limit_torque(design, request.limit_by, world.robot)
    if design.way == PLAN:
        return PlannedRise(
            world,
            torque_limit=limit,
            search_budget=request.search_budget,
            options=PlannerOptions(threads=threads),
        )
    return make_strategy(world, design.way, torque_limit=limit)


def _summarize(
    request: SweepRequest, designs: Sequence[Design], found: Mapping[str, SweptClass]
) -> Sweep:
    cases = {
        design.name: SweptDesign.join(
            design, {side: found[name_part(design, side)] for side in CLASSES}
        )
        for design in designs
    }
    return Sweep(
        name="sweep",
        seed=request.seed,
        n=request.n,
        robot=load_robot(request).name,
        limit_by=request.limit_by,
        versions=Versions.find(request.robot),
        search_budget_s=request.search_budget,
        axes=list_axes(cases.values()),
        cases=cases,
        command=write_command("sweep", _leave_out_engine(request)),
    )


def _leave_out_engine(request: SweepRequest) -> SweepRequest:
    """Return the request without what no result depends on."""
    return replace(request, engine="local", address="", out=SweepRequest().out, resume=False)
