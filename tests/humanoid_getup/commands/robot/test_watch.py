"""`getup watch`: a table of a limp robot, until q, Ctrl-C or its time."""

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from paths import TINY
from run_getup import Run
from waiting import LONGEST_WAIT, wait_until

from drivers import DriverError
from humanoid_getup.commands.prompt import QuitKey
from humanoid_getup.commands.robot import watch as jobs

LYING = ("watch", "--robot", str(TINY), "--from", "prone")
SHORT = (*LYING, "--seconds", "0.2")


@pytest.mark.parametrize("backend", ["twin", "virtual"])
def test_what_was_seen_is_printed_at_the_end(backend: str, run: Run):
    code, out, _ = run(*SHORT, "--backend", backend)
    text = " ".join(out.split())
    assert code == 0
    assert "tiny: watched for 0.2 s in 25 cycles: 0.2 s were up" in text
    assert "torque off, 12.0 V torso on its belly: pitch +8" in text
    assert "l_hip" in out
    assert "-90 to +60" in out, "the range of its joints"
    assert text.endswith("backward"), "which way is positive"


def test_a_fault_gives_its_exit_code(run: Run, monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise DriverError("the cable is loose")

    monkeypatch.setattr(jobs.CancellableGuard, "write", fail)
    code, out, _ = run(*SHORT)
    assert code == 3
    assert "the cable is loose" in out


@pytest.mark.parametrize(("sent", "is_over"), [(b"x", False), (b"q", True), (b"Q", True)])
def test_only_q_ends_it(sent: bytes, is_over: bool):
    master, slave = pty.openpty()
    key, noted = QuitKey(slave), list[bytes]()
    note = key._on_press
    key._on_press = lambda pressed: (note(pressed), noted.append(pressed))[0]
    with key:
        os.write(master, sent)
        wait_until(lambda: noted == [sent])
        assert key.is_pressed() is is_over
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("end", ["q", "interrupt", "hang-up"])
def test_in_a_terminal_a_table_follows_the_robot_until_a_person_ends_it(end: str, tmp_path: Path):
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "humanoid_getup.commands.main", *LYING]
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
    with subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=environment, cwd=tmp_path
    ) as watching:
        os.close(slave)
        assert "q ends it" in _read(master, "torso on its belly")
        if end == "hang-up":
            os.close(master)
            watching.wait(LONGEST_WAIT)
            return
        if end == "q":
            os.write(master, b"q")
        else:
            watching.send_signal(signal.SIGINT)
        shown = _read(master)
        reason = "a person ended it" if end == "q" else "it was interrupted"
        assert reason in shown
        os.close(master)
        assert watching.wait(LONGEST_WAIT) == 0


def _read(terminal: int, until: str | None = None) -> str:
    """Read what a program shows until it shows a text, or to its end."""
    shown = ""
    while until is None or until not in shown:
        try:
            shown += os.read(terminal, 65536).decode(errors="replace")
        except OSError:  # of a terminal that no program has
            return shown
    return shown
