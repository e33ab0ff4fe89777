"""`getup first-steps` on the virtual bus in real time, from the port to the first rise."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from paths import REPOSITORY
from terminal import Terminal, in_terminal

STEP_TIME = 240.0  # s that the longest step may take
TRIES = 3  # of the rise


class Bus:
    """`getup bus` and the person who types there."""

    def __init__(self, program: subprocess.Popen) -> None:
        self._program = program

    def do(self, sentence: str) -> None:
        """Type a sentence, and wait until it is done."""
        assert self._program.stdin is not None
        assert self._program.stdout is not None
        self._program.stdin.write(f"{sentence}\n")
        self._program.stdin.flush()
        assert self._program.stdout.readline() == f"done: {sentence}\n"


@contextmanager
def serving(link: Path, *arguments: str) -> Iterator[Bus]:
    command = [sys.executable, "-m", "humanoid_getup.cli.main", "bus", "--link", str(link)]
    pipe = subprocess.PIPE
    with subprocess.Popen([*command, *arguments], stdin=pipe, stdout=pipe, text=True) as program:
        try:
            assert program.stdout is not None
            assert program.stdout.readline() == f"{link}\n"
            yield Bus(program)
        finally:
            program.terminate()


def begin(steps: Terminal, name: str) -> None:
    """Begin a step by Enter."""
    steps.see(rf"step \d+ of \d+, {name}:.*", STEP_TIME)
    steps.see("q leaves:")
    steps.type("\n")


def complete(steps: Terminal, name: str) -> None:
    """Begin a step, and repeat it where a busy computer fails it, until the next one comes."""
    begin(steps, name)
    for _ in range(TRIES):
        if steps.see(rf"{name} is not done|step \d+ of", STEP_TIME)[0].startswith("step"):
            return
        steps.see("q leaves:")
        steps.type("\n")
    raise AssertionError(steps.shown[-1500:])


def go_on(steps: Terminal) -> None:
    """Begin the step that `complete` has seen."""
    steps.see("q leaves:")
    steps.type("\n")


def skip(steps: Terminal, name: str) -> None:
    steps.see(rf"step \d+ of \d+, {name}:.*", STEP_TIME)
    steps.see("q leaves:")
    steps.type("s\n")


def turn_each(steps: Terminal, bus: Bus, count: int) -> None:
    """Turn the joints as they are asked for."""
    for _ in range(count):
        asked = steps.see(r"turn (\w+) in its positive direction")
        steps.see(r"\(s skips it\):")
        bus.do(f"turn {asked[1]}:12")
        steps.type("\n")
        steps.see("so its sign is")


@pytest.mark.realtime
def test_an_op3_gets_from_its_port_to_the_first_rise(tmp_path: Path):
    robot = shutil.copytree(REPOSITORY / "robots" / "op3", tmp_path / "mine")
    link, out = tmp_path / "port", tmp_path / "out"
    where = ("--robot", str(robot), "--port", str(link), "--out", str(out))
    with serving(link, "--robot", str(robot), "--hold", "zero") as bus:
        with in_terminal("first-steps", *where) as steps:
            begin(steps, "scan")
            skip(steps, "ids")
            complete(steps, "doctor")
            go_on(steps)
            turn_each(steps, bus, 20)
            steps.see("yes saves")
            steps.type("yes\n")
            steps.see(r"step \d+ of \d+, zeros")
            bus.do("hold zero")
            steps.see("q leaves:")
            steps.type("q\n")
            assert steps.wait() == 0
        with in_terminal("first-steps", *where) as steps:  # goes on where it ended
            begin(steps, "zeros")
            steps.see("hold it still")
            steps.type("\n")
            steps.see("yes saves")
            steps.type("yes\n")
            begin(steps, "watch")
            steps.see(r"head_tilt .*")
            steps.type("q")
            complete(steps, "wiggle")
            assert "20 followed" in steps.shown
            bus.do("hold standing")
            squat(steps)
            begin(steps, "preflight")
            steps.see(r"step \d+ of \d+, rise", STEP_TIME)
            rise(steps, bus)
            assert steps.wait() == 0
    assert "calibration.virtual.toml" in {file.name for file in robot.iterdir()}
    done = json.loads((out / "first_steps.json").read_text())["steps"]
    assert [step["name"] for step in done if step["skipped"]] == ["ids"]
    report = json.loads((out / "rise" / "report.json").read_text())
    assert report["stood"]


def rise(steps: Terminal, bus: Bus) -> None:
    """Rise, then sit; a busy computer that ends a rise gets another try, by the same words."""
    for _ in range(TRIES):
        bus.do("lay supine")
        steps.see("q leaves:")
        steps.type("\n")
        if steps.see(r"press|rise is not done", STEP_TIME)[0] == "press":
            steps.type(" ")
            if steps.see(r"all steps are done|rise is not done", STEP_TIME)[0].startswith("all"):
                return
    raise AssertionError(steps.shown[-1500:])


def squat(steps: Terminal) -> None:
    """Bend the legs, once more where a busy computer stops it."""
    for _ in range(TRIES):
        go_on(steps)
        steps.see("yes does it")
        steps.type("yes\n")
        if steps.see(r"\bfollowed: squat|squat is not done", STEP_TIME)[0].startswith("followed"):
            return
    raise AssertionError(steps.shown[-1500:])
