"""The command line: one program, `getup`."""

from __future__ import annotations

import errno
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Sequence

from humanoid_getup.commands.errors import (
    BAD_INPUT,
    CLOSED_PIPE,
    HARDWARE_FAULT,
    INTERRUPTED,
    OUT_OF_MEMORY,
    BadInputError,
)

SIGNALS = tuple(name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
SHORTAGE = re.compile("llocate memory|map segment from shared object$|start new thread", re.M)
"""What the system and MuJoCo, imports, and Python's threads say where memory is short."""
_interrupted = threading.Event()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    try:
        # A program that is to stop must switch torque off, and in the background too,
        # where a shell has Ctrl-C ignored.
        _interrupted.clear()
        if threading.current_thread() is threading.main_thread():
            for name in SIGNALS:
                signal.signal(getattr(signal, name), _interrupt)
        if isinstance(sys.stdout, io.TextIOWrapper):  # names of files need not be UTF-8
            sys.stdout.reconfigure(errors="backslashreplace")
        from humanoid_getup.commands.command_line import (
            parse,  # takes time: signals are handled before
        )

        work = parse(sys.argv[1:] if arguments is None else arguments).load()
        if _interrupted.is_set():  # Python's locks of imports swallow what interrupts them
            raise KeyboardInterrupt
        code = work()
        if sys.stdout is not None:  # None if the shell closed it
            sys.stdout.flush()
        return code
    except KeyboardInterrupt as interrupt:
        # Its text says that a robot was handed over under torque.
        return _report(": ".join(["interrupted", *map(str, interrupt.args)]), INTERRUPTED)
    except Exception as error:
        code = _report_failure(error)
        for note in getattr(error, "__notes__", ()):  # that a robot was handed over under torque
            _report(note, code)
        return code


def _interrupt(_number: int, _frame: object) -> None:
    # A second signal must not interrupt what the first one begins: switching torque off.
    for name in (*SIGNALS, "SIGTSTP"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    _interrupted.set()
    raise KeyboardInterrupt


def _report_failure(error: Exception) -> int:
    """Report errors that a user can correct in one line; raise all others again."""
    drivers = sys.modules.get("drivers.errors")  # if it is not loaded, the error is none of them
    if drivers and isinstance(error, drivers.DriverError):
        is_setup = isinstance(error, drivers.SetupError)
        return _report(str(error), BAD_INPUT if is_setup else HARDWARE_FAULT)
    # Libraries turn an interrupt of their import, or of a call of C, into errors of their own.
    cause = error.__cause__ or error
    if _interrupted.is_set() and not (isinstance(cause, OSError) and cause.errno):
        return _report("interrupted", INTERRUPTED)
    if isinstance(error, BadInputError) and not SHORTAGE.search(str(error)):
        for problem in error.problems:
            _report(problem, BAD_INPUT)
        return BAD_INPUT
    # MuJoCo chooses its GL when it is imported, and refuses a GL that does not exist.
    if isinstance(error, RuntimeError) and "MUJOCO_GL" in str(error):
        return _report(f"{error}, expected egl, osmesa, glfw or disable", BAD_INPUT)
    causes = (error, error.__cause__, error.__context__)
    if short := [e for e in causes if isinstance(e, MemoryError) or SHORTAGE.search(str(e))]:
        text = f"too little memory, or too few threads ({short[-1]!r:.200}), expected more"
        advice = "close other programs, or raise the limits `ulimit -v` and `ulimit -u`"
        return _report(f"{text}: {advice}", OUT_OF_MEMORY)
    if not isinstance(error, OSError):
        raise error
    if error.filename is None and error.errno in (None, errno.ENOENT):  # a library's own text
        return _report(error.strerror or str(error), BAD_INPUT)
    if error.filename is None:
        _discard_output()
    if isinstance(error, BrokenPipeError):
        return CLOSED_PIPE
    return _report(f"{error.filename or 'standard output'}: {error.strerror}", BAD_INPUT)


def _report(message: str, code: int) -> int:
    print(f"getup: {' '.join(message.split())}", file=sys.stderr)
    return code


def _discard_output() -> None:
    """Discard output, so that Python's flush at exit succeeds where it cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
