"""The results of a rise or of a stand: a report, and files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from msgspec import UNSET, UnsetType, structs
from rich.console import Console

from drivers import Ending
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, HARDWARE_FAULT, INTERRUPTED
from humanoid_getup.commands.files import staging
from humanoid_getup.commands.get_up.options import (
    ARTEFACTS,
    MOTION,
    REPORT,
    STRIP,
    STYLE,
    TORQUE,
    GetUpOptions,
    MoveOptions,
)
from humanoid_getup.commands.get_up.recording import FLIGHT
from humanoid_getup.execution.after_stand import AfterStand, naming_hand_over
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import Then
from humanoid_getup.experiments.falls import Fall
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Motion
from humanoid_getup.reporting import film_strip, plots
from humanoid_getup.reporting.figure import save_figure
from humanoid_getup.reporting.report import (
    ReportHead,
    RiseReport,
    StandReport,
    print_summary,
)
from humanoid_getup.reporting.video import save_video
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.keyed_rise import find_passes
from humanoid_getup.strategies.plan import KeyFigures
from robots.storage.encoding import to_json
from robots.storage.files import describe, write_atomically

OWN_START, WHERE_IT_LAY = "the motion's own", "where the robot lay"
SETTINGS = ("method", "planning", "filtering")
NO_ORIENTATION = "without an IMU the orientation of the robot is unknown"


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedWork:
    """What a job that moved a robot leaves behind."""

    world: World
    start: Fall | None
    """Where a simulated robot was placed; None for a real one."""
    files: tuple[Path, ...]
    """Files that were written into the folder of the request."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedRise(FinishedWork):
    """A rise that ended, whether or not the robot stands."""

    rise: Rise
    report: RiseReport

    def naming_hand_over(self) -> AbstractContextManager[None]:
        """Name the robot that was handed over, if it was, where a block fails."""
        return naming_hand_over(lambda: self.rise.hand_over)

    def describe(self) -> RiseReport:
        """Return the report, for JSON."""
        return self.report


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedStand(FinishedWork):
    """A stand that was kept and ended."""

    stand: AfterStand
    report: StandReport

    def naming_hand_over(self) -> AbstractContextManager[None]:
        """Name the robot that was handed over, if it was, where a block fails."""
        return naming_hand_over(lambda: self.stand.hand_over)

    def describe(self) -> StandReport:
        """Return the report, for JSON."""
        return self.report


def finish_rise(
    result: Rise,
    start: Fall | None,
    world: World,
    request: GetUpOptions,
    motion: Motion | None = None,
    findings: Sequence[str] = (),
) -> FinishedRise:
    """Report a rise, with what was found beside it, and write its files."""
    origin = request.origin or (OWN_START if start else WHERE_IT_LAY)
    with naming_hand_over(lambda: result.hand_over):
        figures = vars(result.figures()) | {"keys": _measure_keys(result, world)}
        figures["period_s"] = figures["period_s"] or world.robot.control_period
        if motion is not None:
            figures |= {"motion": motion.name, "strategy": motion.strategy}
        settings = {
            key: getattr(request, key, UNSET) for key in ("method", "planning", "filtering")
        }
        head = vars(_make_head(result, world, request, request.ending, origin))
        report = RiseReport(**figures, **settings, **head)
        report.warnings.extend(findings)
        if request.out is not None:
            with staging(request.out, ARTEFACTS) as folder:
                report = replace(report, strip_reason=_draw(result, world, request, folder))
                _draw_style(report, request.out / FLIGHT, folder / STYLE)
                write_atomically(folder / REPORT, to_json(report))
        moves = [move.outcome for move in result.moves]
        problem = _film(result.outcome, world, request, moves)
        report.warnings.extend([problem] if problem else [])
    files = _list_files(request, filmed=not problem)
    return FinishedRise(rise=result, report=report, world=world, start=start, files=files)


def finish_stand(
    result: AfterStand, world: World, request: MoveOptions, then: Then, start: Fall | None
) -> FinishedStand:
    """Report how a stand was kept and ended, and what followed, and write the files."""
    with naming_hand_over(lambda: result.hand_over):
        report = StandReport(
            **vars(_make_head(result, world, request, then)), **vars(result.figures())
        )
        if request.out is not None:
            with staging(request.out, ARTEFACTS) as folder:
                reason = _draw_way_down(result, world, request, folder)
                report = replace(report, strip_reason=reason)
                write_atomically(folder / REPORT, to_json(report))
        problem = _film(result.way_down and result.way_down.outcome, world, request)
        report = replace(report, strip_reason=problem) if problem else report
    files = _list_files(request, filmed=not problem)
    return FinishedStand(stand=result, report=report, world=world, start=start, files=files)


def _list_files(request: MoveOptions, *, filmed: bool) -> tuple[Path, ...]:
    """List the files of a run; those of earlier runs in its folder were removed or renamed."""
    files = [] if request.out is None else [request.out / n for n in (*ARTEFACTS, FLIGHT)]
    files += [request.video] if filmed and request.video is not None else []
    return tuple(file for file in files if file.exists())


def _film(
    outcome: Outcome | None, world: World, request: MoveOptions, moves: Sequence[Outcome] = ()
) -> str:
    """Save the video that is requested, if any; return why there is none."""
    if request.video is None:
        return ""
    if outcome is None or not len(outcome.qpos):
        return f"no {request.video.name}: nothing was played"
    states = np.concatenate([*(move.qpos for move in moves), outcome.qpos])
    times = np.arange(float(len(states))) * world.robot.control_period
    try:
        save_video(world.robot, world.model, times, states, request.video)
    except (film_strip.NoRendererError, OSError) as error:
        return f"no {request.video.name}: {error}"
    return ""


def _make_head(
    result: Rise | AfterStand,
    world: World,
    request: MoveOptions,
    then: Then,
    start: str | UnsetType = UNSET,
) -> ReportHead:
    return ReportHead(
        robot=world.robot.name,
        body=str(world.robot.body),
        load=world.robot.load or None,
        identified=str(world.robot.individual),
        seed=request.seed,
        start=start,
        scene=request.scene,
        backend=request.backend,
        torque_limit_nm=request.torque_limit,
        limit_by=request.limit_by or world.robot.limit_by,
        then=then,
        unreleased_joints=result.unreleased,
    )


def _measure_keys(result: Rise, world: World) -> list[KeyFigures]:
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


def _draw(result: Rise, world: World, request: GetUpOptions, folder: Path) -> str | None:
    """Write the motion and the pictures; return why there is no film strip."""
    if not result.has_imu:
        return NO_ORIENTATION
    if result.outcome is None or not len(result.outcome.qpos):
        return "nothing was played"
    robot, outcome, plan = world.robot, result.outcome, result.plan
    if plan.motion is not None:
        plan.motion.save(folder / MOTION)
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
    return draw_run(outcome, world, request, folder, title, end, moves)


def _draw_style(report: RiseReport, flight: Path, picture: Path) -> None:
    """Draw how a style was followed, if one was and there is a flight log."""
    if report.style is None or not flight.exists():
        return
    title = f"{report.robot}, {report.start_class}: style {report.style}"
    try:
        if figure := plots.draw_followed(FlightRecord.load(flight), title=title):
            save_figure(figure, picture, dpi=plots.DPI)
    except (ValueError, OSError) as error:  # an incomplete log, a full disk
        report.warnings.append(f"no {STYLE}: {describe(error)}")


def _draw_way_down(
    result: AfterStand, world: World, request: MoveOptions, folder: Path
) -> str | None:
    """Draw how a robot lay down; return why there is no film strip."""
    outcome = result.way_down and result.way_down.outcome
    if outcome is None or not len(outcome.qpos):
        return "the robot did not lie down"
    return draw_run(outcome, world, request, folder, f"{world.robot.name}: sitting and lying down")


def draw_run(
    outcome: Outcome,
    world: World,
    request: MoveOptions,
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
        plots.save_torque(robot, outcome, request.torque_limit, folder / TORQUE, title=title)
        film_strip.save_run(robot, world.model, states, shown, folder / STRIP, title=title)
    except film_strip.NoRendererError as error:
        return str(error)
    except OSError as error:  # a full disk, on which the small files may have room
        return f"{Path(str(error.filename)).name}: {describe(error)}"
    return None


def print_rise(done: FinishedRise, _: GetUpOptions, console: Console) -> int:
    """Print the result of a rise; return the exit code."""
    print_summary(done.report, list(map(str, done.files)), console)
    result, after = done.rise, done.rise.after
    if result.stood and (after is None or after.succeeded):
        return DID_IT
    if after is not None and after.interrupted:
        return INTERRUPTED
    cut_off = result.run is not None and result.run.ending is Ending.FAULT
    by_fault = result.by_fault or cut_off or (after is not None and after.by_fault)
    return HARDWARE_FAULT if by_fault else DID_NOT_STAND
