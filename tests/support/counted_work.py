"""Work of workers in tests: it leaves traces in a folder."""

from __future__ import annotations

import os
import signal
import time
from functools import cached_property
from multiprocessing import get_context
from pathlib import Path
from uuid import uuid4

from humanoid_getup.progress.callback import Progress
from humanoid_getup.progress.worker import report

TRACE = "tried"


def square(number: int) -> int:
    """Square a number."""
    return number * number


def square_slowly(number: int) -> int:
    """Square a number, the first ones last."""
    time.sleep(0.02 * (5 - number % 5))
    return number * number


class LoadedSquares:
    """Squares numbers with what it loads, of which it leaves a trace."""

    def __init__(self, folder: Path) -> None:
        """Leave a trace in a folder with each load."""
        self.folder = folder

    @cached_property
    def power(self) -> int:
        """Load the power."""
        Path(self.folder, uuid4().hex).touch()
        return 2

    def __call__(self, number: int) -> int:
        """Square a number."""
        time.sleep(0.1)
        return number**self.power


def name_process(_piece: int) -> int:
    """Return the number of the process."""
    return os.getpid()


def refuse(number: int) -> int:
    """Refuse a number."""
    raise ValueError(f"number is {number}, expected another")


def die_once(piece: tuple[Path, int]) -> int:
    """Square a number; the first try of number 3 ends its process."""
    folder, number = piece
    with (folder / f"{TRACE}_{number}").open("a") as file:
        file.write("x")
    if number == 3 and len((folder / f"{TRACE}_3").read_text()) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def die(_number: int) -> int:
    """End the process."""
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def square_in_a_child(number: int) -> int:
    """Square a number in a process that this one starts."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(square, (number,))


class StubbornError(Exception):
    """An error that cannot be unpickled."""

    def __init__(self, name: str, value: int) -> None:
        super().__init__(f"{name} is {value}")


def fail_stubbornly(number: int) -> int:
    """Raise an error that cannot be unpickled."""
    raise StubbornError("number", number)


def report_until_seen(file: str) -> int:
    """Report, and end when a file is there."""
    report(Progress(phase=file))
    while not Path(file).exists():
        time.sleep(0.01)
    return 0


def compute_for_ever(folder: str) -> int:
    """Leave the number of the process in a folder, and compute without end."""
    Path(folder, str(os.getpid())).touch()
    while True:
        pass


def wait_for_end(folder: str) -> int:
    """Leave the number of the process in a folder when it is terminated."""
    try:
        report(Progress(phase="waiting"))
        while True:
            time.sleep(0.01)
    finally:
        Path(folder, str(os.getpid())).touch()
