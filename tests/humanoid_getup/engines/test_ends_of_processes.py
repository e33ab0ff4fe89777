"""Workers end with the process that started them, even if that is killed."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import wait_until

PROGRAM = """
import sys
from counted_work import compute_for_ever
from engine_runs import run

if __name__ == "__main__":
    run("local:2", compute_for_ever, [sys.argv[1]] * 2)
"""


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("message", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_when_their_parent_is_killed(message: int, tmp_path: Path):
    program, folder = tmp_path / "compute.py", tmp_path / "workers"
    program.write_text(PROGRAM)
    folder.mkdir()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, str(program), str(folder)], env=environment) as process:
        wait_until(lambda: len(list(folder.iterdir())) == 2)
        process.send_signal(message)
        process.wait()
    workers = [int(path.name) for path in folder.iterdir()]
    assert len(workers) == 2
    wait_until(lambda: not any(map(is_running, workers)))
