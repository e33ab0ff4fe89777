"""The console: lines and tables on standard output, progress on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress as Bars
from rich.progress import TaskID
from rich.status import Status
from rich.table import Table

from humanoid_getup.commands.files import STANDARD_OUTPUT
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.progress.callback import Progress, Report

SMALL_FIGURE = 0.1  # below which two decimals are too few
ROUNDING = 1e-9  # below which a figure is 0
WIDTH = 120  # characters of a line that goes to no terminal
LINE_EVERY = 60.0  # s between lines of progress that go to no terminal


def count_of(number: int, noun: str) -> str:
    """Write a number of things: 1 servo, 2 servos."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


class PipeConsole(Console):
    """A console that leaves a closed pipe to `main`; rich would exit with code 1."""

    def on_broken_pipe(self) -> None:
        """Raise the `BrokenPipeError` again."""
        raise


def find_json_target(command: CommandRequest | None) -> str | None:
    """Return the file of a command's JSON, "-" for standard output, ``None`` for none."""
    return getattr(command, "json", None)


def console_for(command: CommandRequest | None = None) -> Console:
    """Return the console for people: standard error where JSON takes standard output."""
    is_json = find_json_target(command) == STANDARD_OUTPUT
    console = PipeConsole(stderr=is_json, highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    return console


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print(f"getup: {text}", file=sys.stderr)


@contextmanager
def phase(text: str) -> Iterator[Callable[[str], None]]:
    """Show what a command is doing on standard error; yield what changes the text."""
    with Console(stderr=True).status(text) as status:
        yield status.update


@contextmanager
def showing(command: CommandRequest | None = None, *, in_lines: bool = False) -> Iterator[Report]:
    """Show progress on standard error, and findings to people; yield what shows them.

    With ``in_lines``, progress is one line, and findings are warnings on standard error.
    """
    display = ProgressDisplay(console_for(command))

    def show_in_lines(progress: Progress) -> None:
        if progress.message:
            warn(progress.message)
        else:
            display.show(Progress(phase=str(progress)))

    try:
        yield show_in_lines if in_lines else display.show
    finally:
        display.stop()


class ProgressDisplay:
    """Shows a text or a bar for each phase, and lines for findings.

    What goes to no terminal has no bars, but a line from time to time.
    """

    def __init__(self, findings: Console) -> None:
        """Show progress on standard error, and findings on a console."""
        self._findings = findings
        self._status: Status | None = None
        self._bars: Bars | None = None
        self._tasks: dict[str, TaskID] = {}
        self._lines = Console(stderr=True, highlight=False, width=WIDTH)
        self._said = time.monotonic()

    def show(self, progress: Progress) -> None:
        """Show the progress of the work."""
        if progress.message:
            self.stop()
            self._findings.print(progress.message, markup=False, soft_wrap=True)
        elif not self._lines.is_terminal:
            self._say(progress)
        elif progress.total is None:
            self._show_text(progress.phase)
        else:
            self._show_bar(progress)

    def stop(self) -> None:
        """Clear the progress, so that lines can be printed; later progress is shown again."""
        if self._status is not None:
            self._status.stop()
        if self._bars is not None:
            self._bars.stop()
        self._status = self._bars = None

    def _say(self, progress: Progress) -> None:
        """Print a line of progress, if the last one is long ago."""
        now = time.monotonic()
        if now - self._said < LINE_EVERY:
            return
        self._said = now
        self._lines.print(str(progress), markup=False, soft_wrap=True)

    def _show_text(self, text: str) -> None:
        if self._status is None:
            self.stop()
            self._status = Console(stderr=True).status(text)
            self._status.start()
        self._status.update(text)

    def _show_bar(self, progress: Progress) -> None:
        if self._bars is None:
            self.stop()
            self._bars, self._tasks = make_bars(), {}
            self._bars.start()
        bars, name = self._bars, progress.phase
        if name not in self._tasks:
            self._tasks[name] = bars.add_task(name, total=progress.total, note="")
        bars.update(self._tasks[name], completed=progress.done, note=progress.note)


def make_bars(console: Console | None = None) -> Bars:
    """Make bars of one line each; notes are cut to fit into the terminal."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column

    console = console or Console(stderr=True)
    line, cut = Column(no_wrap=True), Column(no_wrap=True, overflow="ellipsis", ratio=1)
    return Bars(
        TextColumn("{task.description}", markup=False, table_column=line),  # may name a file
        BarColumn(bar_width=min(40, console.width // 8)),
        MofNCompleteColumn(table_column=line.copy()),
        TimeElapsedColumn(table_column=line.copy()),
        TimeRemainingColumn(table_column=line.copy()),
        TextColumn("{task.fields[note]}", style="dim", markup=False, table_column=cut),
        console=console,
        expand=True,
    )


def make_table(headings: Sequence[str], *, left: Sequence[str]) -> Table:
    """Make a table of numbers, to the right, and of the texts under the headings in ``left``."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for heading in headings:
        table.add_column(escape(heading), justify="left" if heading in left else "right")
    return table


def format_figure(value: Any) -> str:
    """Write a figure, an interval, counts, or a median with its 95th percentile, for people."""
    if isinstance(value, dict):
        return ", ".join(f"{count} {name}" for name, count in value.items())
    if hasattr(value, "p95"):
        return f"{format_figure(value.median)} (p95 {format_figure(value.p95)})"
    if isinstance(value, list | tuple):
        return " to ".join(map(format_figure, value))
    if not isinstance(value, float):
        return str(value)
    is_small = ROUNDING < abs(value) < SMALL_FIGURE
    return f"{value:.2g}" if is_small else f"{value:.2f}"
