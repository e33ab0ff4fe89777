"""`getup rise`, `run`, `play`, `sit`, `hold` and `fall`: phases, JSON, a summary, an exit code."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from rich.markup import escape

from drivers import Ending
from humanoid_getup.cli.get_up.operator_key import OperatorKey
from humanoid_getup.commands.console import console_for, showing
from humanoid_getup.commands.exit_codes import (
    DID_IT,
    DID_NOT_STAND,
    HARDWARE_FAULT,
    INTERRUPTED,
)
from humanoid_getup.commands.inputs import FALL, find_start, load_world
from humanoid_getup.commands.output import write_json
from humanoid_getup.execution.after_stand import naming_hand_over
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.jobs.get_up import rise as rises
from humanoid_getup.jobs.get_up import stand
from humanoid_getup.jobs.get_up.results import FinishedRise, FinishedStand
from humanoid_getup.jobs.requests.rise import (
    FallRequest,
    GetUpOptions,
    HoldRequest,
    MoveOptions,
    PlayRequest,
    RiseRequest,
    RunRequest,
    SitRequest,
)
from humanoid_getup.progress.callback import Progress, Report
from humanoid_getup.reporting.report import print_summary
from robots.description.posture_file import format_posture
from robots.storage.files import write_atomically


def rise(command: RiseRequest) -> int:
    """Rise by plan, by policy, or by the better of both; return the exit code."""
    return _get_up(rises.rise, command)


def run_policy(command: RunRequest) -> int:
    """Rise once by a policy; return the exit code."""
    return _get_up(rises.run_policy, command)


def play(command: PlayRequest) -> int:
    """Rise once by one motion; return the exit code."""
    return _get_up(rises.play_motion, command)


def _get_up(job: Callable[..., FinishedRise], command: GetUpOptions) -> int:
    with showing_phases() as report:
        done = job(command, report, operator=OperatorKey(realtime=command.is_realtime))
    return show_rise(done, command)


def sit(command: SitRequest) -> int:
    """Sit and lie down; return the exit code."""
    return _keep_stand(stand.sit, command)


def hold(command: HoldRequest) -> int:
    """Hold a stand, and end it; return the exit code."""
    return _keep_stand(stand.hold, command)


def _keep_stand(job: Callable[..., FinishedStand], command: SitRequest | HoldRequest) -> int:
    with showing_phases() as report:
        done = job(command, report, operator=OperatorKey(realtime=command.is_realtime))
    return show_stand(done, command)


@contextmanager
def showing_phases() -> Iterator[Report]:
    """Show phases and warnings in lines on standard error; yield what shows them."""
    with showing() as report:

        def show(progress: Progress) -> None:
            if progress.message:
                print(f"getup: {progress.message}", file=sys.stderr)
            else:
                report(Progress(phase=str(progress)))

        yield show


def show_rise(done: FinishedRise, command: MoveOptions) -> int:
    """Write and print the result of a rise; return the exit code."""
    with naming_hand_over(lambda: done.rise.hand_over):
        write_json(done.report, command)
        print_summary(done.report, list(map(str, done.files)), console_for(command))
    return _find_exit_code(done.rise)


def show_stand(done: FinishedStand, command: MoveOptions) -> int:
    """Write and print how a stand was kept and ended; return the exit code."""
    result, console = done.stand, console_for(command)
    with naming_hand_over(lambda: result.hand_over):
        write_json(done.report, command)
        color = "green" if result.succeeded else "red"
        console.print(f"[bold {color}]{escape(result.reason)}")
        if result.hand_over is not None:
            console.print(escape(str(result.hand_over)))
    if result.succeeded:
        return DID_IT
    if result.interrupted:
        return INTERRUPTED
    return HARDWARE_FAULT if result.by_fault else DID_NOT_STAND


def _find_exit_code(result: RiseResult) -> int:
    after = result.after
    if result.stood and (after is None or after.succeeded):
        return DID_IT
    if after is not None and after.interrupted:
        return INTERRUPTED
    cut_off = result.run is not None and result.run.ending is Ending.FAULT
    by_fault = result.by_fault or cut_off or (after is not None and after.by_fault)
    return HARDWARE_FAULT if by_fault else DID_NOT_STAND


def fall(command: FallRequest) -> int:
    """Write the posture of a sampled fall; return the exit code."""
    FallRequest.accept(command)
    world = load_world(command)
    lying = find_start(world, command.origin, np.random.default_rng(command.seed))
    record = json.loads(format_posture(lying.posture, world.robot)) | {FALL: command.origin}
    write_json(record, command)
    if command.out is not None:
        command.out.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(command.out, json.dumps(record, indent=1) + "\n")
        console_for(command).print(
            f"{world.robot.name} lies {lying.start_class}, seed {command.seed}: {command.out}",
            markup=False,
            soft_wrap=True,
        )
    return DID_IT
