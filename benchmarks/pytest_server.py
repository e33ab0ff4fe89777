"""Run pytest again and again in forks of one process that has the slow imports behind it.

Reads a JSON object with `arguments` and `timeout` [s] from each line of standard input and writes
pytest's exit code, or -1 after the timeout, to a line of standard output.
"""

from __future__ import annotations

import importlib
import json
import os
import select
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import Phase, settings

# A failure is enough: hypothesis need not look for the simplest example.
settings.register_profile(
    "mutants",
    deadline=None,
    derandomize=True,
    database=None,
    phases=(Phase.explicit, Phase.generate),
    report_multiple_bugs=False,
)
OPTIONS = ("--hypothesis-profile=mutants", "--tb=no", "-p", "no:cacheprovider", "-q", "-x")
SLOW_IMPORTS = (
    "numpy",
    "scipy.spatial",
    "scipy.optimize",
    "scipy.stats",
    "mujoco",
    "msgspec",
    "onnxruntime",
    "serial",
    "mcap.reader",
    "orjson",
)


def run(arguments: list[str], timeout: float) -> int:
    """Run pytest in a fork; end it, and all that it started, after the timeout [s]."""
    child = os.fork()
    if child == 0:
        os.setsid()
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nowhere, stream)
        os._exit(int(pytest.main([*OPTIONS, *arguments])))
    handle = os.pidfd_open(child)
    ended, _, _ = select.select([handle], [], [], timeout)
    os.close(handle)
    if not ended:
        os.killpg(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return code if ended else -1


def main() -> None:
    """Serve until standard input ends."""
    os.environ.setdefault("MUJOCO_GL", "disable")
    for name in SLOW_IMPORTS:
        try:
            importlib.import_module(name)
        except ImportError:
            continue  # an extra that is not installed; its tests are skipped
    sys.path.insert(0, str(Path.cwd()))
    for line in sys.stdin:
        request = json.loads(line)
        print(run(request["arguments"], request["timeout"]), flush=True)


if __name__ == "__main__":
    main()
