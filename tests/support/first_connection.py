"""`getup bus` and the two persons of a first connection: at the virtual robot, and at the steps."""

import select
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from terminal import Terminal
from waiting import LONGEST_WAIT

STEP_TIME = 240.0  # s that the longest step may take
RISE_TIME = 600.0  # s, with its plan
TRIES = 3  # of a step with motion, which a busy computer may end
ALL_DONE = "all steps are done"


class Bus:
    """`getup bus` and the person who types there."""

    def __init__(self, program: subprocess.Popen[bytes]) -> None:
        self._program = program

    def do(self, sentence: str) -> None:
        """Type a sentence, and wait until it is done."""
        assert self._program.stdin is not None
        self._program.stdin.write(f"{sentence}\n".encode())
        assert self.read_line() == f"done: {sentence}"

    def read_line(self) -> str:
        """Read the next line that the bus prints; a refusal is printed elsewhere."""
        said = self._program.stdout
        assert said is not None
        assert select.select([said], [], [], LONGEST_WAIT)[0], "it says why on its standard error"
        return said.readline().decode().rstrip("\n")


@contextmanager
def serving(link: Path, *arguments: str) -> Iterator[Bus]:
    """Serve a virtual bus at a path, once it has printed that; end it afterwards."""
    command = [sys.executable, "-m", "humanoid_getup.commands.main", "bus", "--link", str(link)]
    pipe = subprocess.PIPE
    with subprocess.Popen([*command, *arguments], stdin=pipe, stdout=pipe, bufsize=0) as program:
        try:
            bus = Bus(program)
            assert bus.read_line() == str(link)
            yield bus
        finally:
            program.terminate()


def begin(steps: Terminal, name: str, prepare: Callable[[], None] = lambda: None) -> None:
    """Begin a step by Enter, once the robot is prepared for it."""
    answer(steps, name, "", prepare)


def skip(steps: Terminal, name: str) -> None:
    """Skip a step."""
    answer(steps, name, "s")


def leave(steps: Terminal, name: str) -> None:
    """Leave at a step."""
    answer(steps, name, "q")


def answer(
    steps: Terminal, name: str, text: str, prepare: Callable[[], None] = lambda: None
) -> None:
    """Answer what a step asks before it runs."""
    steps.see(rf"step \d+, {name}:.*", STEP_TIME)
    steps.see("q leaves:")
    prepare()
    steps.type(f"{text}\n")


def complete(steps: Terminal, name: str, end: str = r"step \d+, ") -> None:
    """Begin a step, agree to what it asks, and repeat it where a busy computer fails it.

    Ends when the next step comes, or what the last one ends with; that is still to be seen.
    """
    begin(steps, name)
    tries = 1
    while seen := steps.see(rf"yes does it|{name} is not done|(?={end})", STEP_TIME)[0]:
        if seen == "yes does it":
            steps.type("yes\n")
            continue
        tries += 1
        assert tries <= TRIES, steps.shown[-1500:]
        steps.see("q leaves:")
        steps.type("\n")


def turn_each(steps: Terminal, bus: Bus, count: int) -> None:
    """Turn the joints as they are asked for."""
    for _ in range(count):
        asked = steps.see(r"turn (\w+) in its positive direction")
        steps.see(r"\(s skips it\):")
        bus.do(f"turn {asked[1]}:12")
        steps.type("\n")
        steps.see("so its sign is")


def save(steps: Terminal) -> None:
    """Agree that a calibration is saved."""
    steps.see("yes saves")
    steps.type("yes\n")


def rise(steps: Terminal, bus: Bus) -> None:
    """Rise, then sit or go limp; what a busy computer ends gets another try, by the same words."""
    steps.see(r"step \d+, rise:.*", STEP_TIME)
    for _ in range(TRIES):
        bus.do("lay supine")
        steps.see("q leaves:")
        steps.type("\n")
        seen = steps.see(rf"press|{ALL_DONE}|rise is not done", RISE_TIME)[0]
        if seen == "press":
            steps.type(" ")
            seen = steps.see(rf"{ALL_DONE}|rise is not done", STEP_TIME)[0]
        if seen == ALL_DONE:
            return
    raise AssertionError(steps.shown[-1500:])
