"""The results of a rise or of a stand: files, JSON, a summary and an exit code."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from msgspec import UNSET, UnsetType, structs
from rich.markup import escape

from drivers import Ending
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.cli.get_up.recording import FLIGHT
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.execution.after_stand import AfterStand
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.jobs.requests.rise import (
    ARTEFACTS,
    REPORT,
    STRIP,
    STYLE,
    TORQUE,
    GetUpOptions,
    HoldRequest,
    MoveOptions,
    SitRequest,
)
from humanoid_getup.motions.motion import Motion
from humanoid_getup.reporting import film_strip, plots, style_plot
from humanoid_getup.reporting.report import (
    ReportHead,
    RiseSettings,
    StandReport,
    make_report,
    print_summary,
)
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.key_record import KeyFigures, find_passes
from robots.storage.encoding import to_json
from robots.storage.files import describe, write_atomically

NO_ORIENTATION = "without an IMU the orientation of the robot is unknown"


@contextmanager
def naming_hand_over(after: AfterStand | None) -> Iterator[None]:
    """Report that a robot was handed over under torque even if its results cannot be written."""
    try:
        yield
    except KeyboardInterrupt:
        if after is None or after.hand_over is None:
            raise
        raise KeyboardInterrupt(str(after.hand_over)) from None


def write_results(
    result: RiseResult,
    world: World,
    options: GetUpOptions,
    start: str,
    settings: RiseSettings,
    motion: Motion | None = None,
) -> int:
    """Write and print the result of a rise; return the exit code."""
    head = _make_head(world, options, start)
    report = make_report(result, head, settings, motion)
    report = replace(report, keys=_measure_keys(result, world))
    files: list[str] = []
    if options.out is not None:
        with staging(options.out, ARTEFACTS) as folder:
            report = replace(report, strip_reason=_draw(result, world, options, folder))
            if report.style is not None and (options.out / FLIGHT).exists():
                title = f"{world.robot.name}, {report.start_class}: style {report.style}"
                try:
                    record = FlightRecord.load(options.out / FLIGHT)
                    style_plot.save_flight(record, folder / STYLE, title=title)
                except (ValueError, OSError) as error:  # an incomplete log, a full disk
                    report.warnings.append(f"no {STYLE}: {describe(error)}")
            write_atomically(folder / REPORT, to_json(report))
            files = [str(options.out / name) for name in ARTEFACTS if (folder / name).exists()]
            files += [str(options.out / FLIGHT)] if (options.out / FLIGHT).exists() else []
            write_json(report, options)  # where it cannot be written, none of the files appears
    else:
        write_json(report, options)
    print_summary(report, files, console_for(options))
    after = result.after
    if result.stood and (after is None or after.succeeded):
        return DID_IT
    cut_off = result.run is not None and result.run.ending is Ending.FAULT
    by_fault = result.by_fault or cut_off or (after is not None and after.by_fault)
    return HARDWARE_FAULT if by_fault else DID_NOT_STAND


def _make_head(
    world: World, options: GetUpOptions | SitRequest | HoldRequest, start: str | UnsetType = UNSET
) -> ReportHead:
    return ReportHead(
        robot=world.robot.name,
        body=str(world.robot.body),
        seed=options.seed,
        start=start,
        scene=options.scene,
        backend=options.backend,
        torque_limit_nm=options.torque_limit,
        limit_by=options.limit_by or world.robot.limit_by,
        then=options.ending if isinstance(options, GetUpOptions) else options.then,
    )


def write_stand_results(result: AfterStand, world: World, options: SitRequest | HoldRequest) -> int:
    """Write and print how a stand was kept and ended; return the exit code."""
    report = StandReport(**vars(_make_head(world, options)), **vars(result.figures()))
    if options.out is not None:
        outcome = result.way_down and result.way_down.outcome
        with staging(options.out, ARTEFACTS) as folder:
            reason = "the robot did not lie down"
            if outcome is not None:
                title = f"{world.robot.name}: sitting and lying down"
                reason = draw_run(outcome, world, options, folder, title)
            report = replace(report, strip_reason=reason)
            write_atomically(folder / REPORT, to_json(report))
            write_json(report, options)
    else:
        write_json(report, options)
    color = "green" if result.succeeded else "red"
    console_for(options).print(f"[bold {color}]{escape(result.reason)}")
    if result.hand_over is not None:
        console_for(options).print(escape(str(result.hand_over)))
    if result.succeeded:
        return DID_IT
    return HARDWARE_FAULT if result.by_fault else DID_NOT_STAND


def _measure_keys(result: RiseResult, world: World) -> list[KeyFigures]:
    """Return the figures of the key postures; kept ones have their error as played."""
    outcome, kept = result.outcome, [key for key in result.plan.keys if key.figures.kept]
    played = dict[int, float]()
    if outcome is not None and kept:
        passes = find_passes(world, outcome.qpos, [key.posture for key in kept])
        played = {id(key): one.largest for key, one in zip(kept, passes, strict=True)}
    return [
        structs.replace(key.figures, played_joint_error_rad=played.get(id(key)))
        for key in result.plan.keys
    ]


def _draw(result: RiseResult, world: World, options: GetUpOptions, folder: Path) -> str | None:
    """Write the motion and the pictures; return why there is no film strip."""
    if not result.has_imu:
        return NO_ORIENTATION
    if result.outcome is None:
        return "nothing was played"
    robot, outcome, plan = world.robot, result.outcome, result.plan
    plan.save(folder)
    end = float(outcome.stand.start_time) + film_strip.AFTERMATH if result.stood else math.inf
    again = result.attempts[-1].start_class if len(result.attempts) > 1 else None
    lay = again or result.start_class
    side = "-side" if lay in ("left", "right") else ""
    where = "" if world.scene.name == FLAT_SCENE.name else f", {world.scene.name}"
    attempt = f", attempt {len(result.attempts)}" if len(result.attempts) > 1 else ""
    title = f"{robot.name}{where}, {lay}{side} start{attempt}: {plan.label}"
    if result.moves:
        moved = result.figures().moves_s
        title += f", after {moved:.1f} s of moves"
    moves = [move.outcome for move in result.moves]
    return draw_run(outcome, world, options, folder, title, end, moves)


def draw_run(
    outcome: Outcome,
    world: World,
    options: MoveOptions,
    folder: Path,
    title: str,
    end: float = math.inf,
    moves: Sequence[Outcome] = (),
) -> str | None:
    """Draw torques, and a film strip up to a time [s] and of the last posture.

    The film begins with the moves that led to the run. Return why there is no film strip.
    """
    robot, period = world.robot, world.robot.control_period
    states = np.concatenate([*(move.qpos for move in moves), outcome.qpos])
    shown = len(states) - len(outcome.qpos) + end / period
    try:
        plots.save_torque(robot, outcome, options.torque_limit, folder / TORQUE, title=title)
        film_strip.save_run(robot, world.model, states, shown, folder / STRIP, title=title)
    except film_strip.NoRendererError as error:
        return str(error)
    except OSError as error:  # a full disk, on which the small files may have room
        return f"{Path(str(error.filename)).name}: {describe(error)}"
    return None
