"""The results of a rise or of a stand: phases, JSON, a summary and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.markup import escape

from drivers import Ending
from humanoid_getup.cli.shared.console import console_for, showing
from humanoid_getup.cli.shared.exit_codes import (
    DID_IT,
    DID_NOT_STAND,
    HARDWARE_FAULT,
    INTERRUPTED,
)
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.execution.after_stand import naming_hand_over
from humanoid_getup.execution.result import RiseResult
from humanoid_getup.jobs.get_up.results import FinishedRise, FinishedStand
from humanoid_getup.jobs.requests.rise import MoveOptions
from humanoid_getup.progress.callback import Progress, Report
from humanoid_getup.reporting.report import print_summary


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
