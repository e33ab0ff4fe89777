"""Runs commands of `getup` in a program of their own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

MODULE = "humanoid_getup.cli.main"


def run_getup(words: Sequence[str]) -> int:
    """Run a command line without "getup" at the same terminal; return its exit code.

    An interrupt is passed on, and waits until the command has switched torque off.
    """
    with subprocess.Popen([sys.executable, "-m", MODULE, *words]) as program:
        try:
            return program.wait()
        except KeyboardInterrupt:
            program.terminate()
            program.wait()
            raise
