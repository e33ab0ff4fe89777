"""The command line: one program, `getup`."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import MutableMapping, Sequence

from humanoid_getup.cli.exit_codes import BAD_INPUT, HARDWARE_FAULT, INTERRUPTED


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    choose_gl(os.environ)
    # A program that is told to stop must let the robot go limp, and in the background too,
    # where a shell has Ctrl-C ignored.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name) and threading.current_thread() is threading.main_thread():
            signal.signal(getattr(signal, name), _interrupt)
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        print("getup: interrupted", file=sys.stderr)
        return INTERRUPTED


def _interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def _run(arguments: Sequence[str] | None) -> int:
    # MuJoCo chooses its GL when it is imported, so all that needs it waits for choose_gl.
    try:
        import mujoco  # noqa: F401
    except RuntimeError as error:  # MUJOCO_GL holds no GL that there is
        return _refuse(f"{error}, allowed egl, osmesa, glfw or disable", BAD_INPUT)
    from drivers import DriverError
    from drivers.errors import SetupError
    from humanoid_getup.cli.commands import parse
    from humanoid_getup.cli.errors import BadInputError

    command = parse(arguments)
    try:
        return command.run()
    except (BadInputError, SetupError) as error:
        return _refuse(str(error), BAD_INPUT)
    except DriverError as error:
        return _refuse(str(error), HARDWARE_FAULT)


def _refuse(message: str, code: int) -> int:
    print(f"getup: {' '.join(message.split())}", file=sys.stderr)
    return code


def choose_gl(environment: MutableMapping[str, str]) -> None:
    """Let MuJoCo render without a display, unless the user chose otherwise."""
    displays = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform == "linux" and not any(environment.get(name) for name in displays):
        environment.setdefault("MUJOCO_GL", "egl")


if __name__ == "__main__":
    sys.exit(main())
