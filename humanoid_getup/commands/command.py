"""Commands: a function of a request, what prints its result, and how the command line runs it.

@command("motions export", json=True)
def export_motion(request: ExportMotionRequest, monitor: ProgressMonitor) -> ExportedMotion:
    ...

@export_motion.show
def _print(found: ExportedMotion, request: ExportMotionRequest, console: Console) -> None:
    ...
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Any, Concatenate, Generic, TypeVar

from rich.console import Console

from humanoid_getup.commands.command_table import COMMANDS
from humanoid_getup.commands.console import console_for, find_json_target, showing
from humanoid_getup.commands.errors import DID_IT, BadInputError, refusing_own
from humanoid_getup.commands.files import STANDARD_OUTPUT
from humanoid_getup.commands.options import CommandRequest, with_json, write_command
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report

Request = TypeVar("Request", bound=CommandRequest)
Result = TypeVar("Result")
Work = Callable[Concatenate[Request, ProgressMonitor, ...], Result]
Show = Callable[[Result, Any, Console], int | None]
_REGISTERED: dict[str, Command[Any, Any] | Program] = {}


class Command(Generic[Request, Result]):
    """Work on a request: a function for programs, and a command of the command line."""

    def __init__(
        self,
        name: str,
        work: Work[Request, Result],
        *,
        json: bool | Callable[[Result], object],
        is_begun: Callable[[Request], bool] | None,
        person: Callable[[Request], dict[str, Any]] | None,
        in_lines: bool,
    ) -> None:
        update_wrapper(self, work)
        self.__dict__.pop("__wrapped__")  # its arguments are not those of a call
        self._name, self._work, self._json = name, work, json
        self._is_begun, self._person, self._in_lines = is_begun, person, in_lines
        self._show: Show[Result] | None = None
        self._request = find_request(work)
        self.options: type[CommandRequest] = with_json(self._request) if json else self._request

    def __call__(
        self,
        request: Request,
        report: Report | None = None,
        cancel: Cancel | None = None,
        **further: Any,
    ) -> Result:
        """Do the work of a request, which is checked first.

        Args:
            request: What is wanted.
            report: Shows progress.
            cancel: Called between two pieces of the work; ends it once it returns True.
            further: Further arguments of the function.

        Raises:
            BadInputError: if the request cannot be done.
            CancelledError: if ``cancel`` ended it; finished parts are kept.
        """
        self._request.accept(request)
        for name, function in (("report", report), ("cancel", cancel)):
            if function is not None and not callable(function):
                raise BadInputError(f"{name} is {function!r:.80}, expected a function")
        operator = further.get("operator")
        if operator is not None and not callable(getattr(operator, "is_released", None)):
            raise BadInputError(f"operator is {operator!r:.80}, expected an Operator")
        return self._do(request, report, cancel, **further)

    def _do(
        self, request: Request, report: Report | None, cancel: Cancel | None = None, **further: Any
    ) -> Result:
        with refusing_own():
            return self._work(request, ProgressMonitor(report, cancel), **further)

    def __reduce__(self) -> str:
        """Pickle it by its name, as functions are: for a process that does its work."""
        return self._work.__qualname__

    def show(self, show: Show[Result]) -> Show[Result]:
        """Register what prints a result and returns the exit code; None is that of success."""
        self._show = show
        return show

    def lead(self, run: Callable[[Any], int]) -> Callable[[Any], int]:
        """Register what runs it on the command line instead, as a person needs it there."""
        self.run = run
        return run

    def run(self, options: Any, /) -> int:
        """Do the work of checked options, show progress and result; return the exit code."""
        person = self._person(options) if self._person else {}
        display = showing(options, in_lines=self._in_lines)
        with self._hinting_resume(options), display as report:
            result = self._do(options, report, **person)
        # A robot that was handed over under torque is named by whatever fails after that.
        with getattr(result, "naming_hand_over", nullcontext)():
            write_json(self._json(result) if callable(self._json) else result, options)
            code = self._show(result, options, console_for(options)) if self._show else None
        return code or DID_IT

    @contextmanager
    def _hinting_resume(self, options: Any) -> Iterator[None]:
        """Add the command that resumes the work to an interrupt (`KeyboardInterrupt`)."""
        try:
            yield
        except KeyboardInterrupt as interrupt:
            if self._is_begun is None or not self._is_begun(options):
                raise
            again = write_command(self._name, replace(options, resume=True))
            raise KeyboardInterrupt(f"{again} continues") from interrupt


class Program:
    """A command that leads a person at the terminal: a function of options, and its exit code."""

    def __init__(self, work: Callable[[Any], int]) -> None:
        update_wrapper(self, work)
        self.options, self._work = find_request(work), work

    def __call__(self, options: CommandRequest) -> int:
        """Run it, unless its options cannot be used; return the exit code."""
        self.options.accept(options)
        return self.run(options)

    def run(self, options: CommandRequest, /) -> int:
        """Run it with checked options; return the exit code."""
        with refusing_own():
            return self._work(options)


def command(
    name: str,
    *,
    json: bool | Callable[[Any], object] = False,
    is_begun: Callable[[Any], bool] | None = None,
    person: Callable[[Any], dict[str, Any]] | None = None,
    in_lines: bool = False,
) -> Callable[[Work[Request, Result]], Command[Request, Result]]:
    """Register a function of a request and a `ProgressMonitor` as a command.

    Args:
        name: Name on the command line.
        json: Whether its result can be written as JSON, or what describes it for that.
        is_begun: Whether work that was interrupted left something with which --resume goes on.
        person: Further arguments of the function for a person at the terminal.
        in_lines: Whether progress is one line, and findings are warnings on standard error.
    """

    def register(work: Work[Request, Result]) -> Command[Request, Result]:
        made = Command(name, work, json=json, is_begun=is_begun, person=person, in_lines=in_lines)
        _REGISTERED[name] = made
        return made

    return register


def program(name: str) -> Callable[[Callable[[Any], int]], Program]:
    """Register a function of options that leads a person at the terminal as a command."""

    def register(work: Callable[[Any], int]) -> Program:
        made = _REGISTERED[name] = Program(work)
        return made

    return register


def find_request(work: Callable[..., object]) -> type[CommandRequest]:
    """Return the type of a function's first argument."""
    kind = next(iter(work.__annotations__.values()))
    return eval(kind, work.__globals__) if isinstance(kind, str) else kind  # our own source


def load_command(name: str) -> Command[Any, Any] | Program:
    """Import a command."""
    import_module(f"humanoid_getup.commands.{COMMANDS[name].module}")
    return _REGISTERED[name]


def write_json(result: object, command: CommandRequest) -> None:
    """Write a result as JSON to the target of a command: a file, standard output, or none."""
    json = find_json_target(command)
    if json is None:
        return
    from robots.storage.encoding import to_json  # loads NumPy, which --help does without

    if json == STANDARD_OUTPUT:
        sys.stdout.write(to_json(result))
        return
    from robots.storage.files import write_atomically

    try:
        Path(json).parent.mkdir(parents=True, exist_ok=True)
        write_atomically(Path(json), to_json(result))
    except OSError as error:
        raise BadInputError(f"output file {json}: {error.strerror}") from error
