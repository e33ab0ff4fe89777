"""Pieces give the same results wherever they are done, and a lost worker costs one of them."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from counted_work import (
    TRACE,
    die,
    die_once,
    fail_stubbornly,
    name_process,
    refuse,
    report_steps,
    square,
    square_in_a_child,
    square_slowly,
    wait_for_end,
)
from engine_runs import run

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.errors import WorkerLostError
from humanoid_getup.engines.local_processes import LocalProcesses
from humanoid_getup.engines.run_pieces import run_pieces, start_workers
from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor

ENGINES = ["local:1", "local:2", "local:3"]
UNGUARDED = """
from counted_work import square
from engine_runs import run

run("local:2", square, [1, 2])
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_results_do_not_depend_on_number_and_order_of_workers(engine: str):
    assert run(engine, square_slowly, [*range(11)]) == [n * n for n in range(11)]


def test_one_worker_is_this_process_and_two_are_others():
    assert set(run("local:1", name_process, [0] * 3)) == {os.getpid()}
    others = set(run("local:2", name_process, [0] * 8))
    assert os.getpid() not in others
    assert len(others) <= 2


@pytest.mark.parametrize("engine", ENGINES)
def test_no_pieces_are_no_work(engine: str):
    assert run(engine, square, []) == []


@pytest.mark.parametrize("engine", ENGINES)
def test_an_error_of_a_piece_is_raised_as_it_is(engine: str):
    with pytest.raises(ValueError, match=r"^number is 7, expected another$"):
        run(engine, refuse, [7])


def test_an_error_that_cannot_travel_arrives_as_its_text():
    with pytest.raises(RuntimeError, match="StubbornError: number is 7"):
        run("local:2", fail_stubbornly, [7, 7])


def test_a_piece_may_start_processes():
    assert run("local:2", square_in_a_child, [2, 3]) == [4, 9]


def test_a_killed_worker_costs_one_piece(tmp_path: Path):
    pieces = [(tmp_path, number) for number in range(9)]
    assert run("local:2", die_once, pieces) == [n * n for n in range(9)]
    tries = [len((tmp_path / f"{TRACE}_{number}").read_text()) for number in range(9)]
    assert tries == [1, 1, 1, 2, 1, 1, 1, 1, 1]


def test_a_piece_that_always_ends_its_worker_is_given_up_in_one_line():
    with pytest.raises(WorkerLostError, match=r"3 tries of a piece \(SIGKILL") as problem:
        run("local:2", die, [1, 2])
    assert str(problem.value).isprintable()


def test_canceled_work_ends_between_two_pieces_and_ends_its_workers():
    done = list[str]()
    monitor = ProgressMonitor(cancel=lambda: len(done) >= 3)
    with (
        pytest.raises(CancelledError),
        start_workers(Engine.parse("local:2"), 1000) as workers,
    ):
        pieces = {str(number): number for number in range(1000)}
        try:
            run_pieces(square_slowly, pieces, workers, lambda name, _: done.append(name), monitor)
        finally:
            assert isinstance(workers.executor, LocalProcesses)
            numbers = workers.executor.process_ids
    assert 3 <= len(done) < 20
    assert len(numbers) == 2
    for number in numbers:
        with pytest.raises(ProcessLookupError):
            os.kill(number, signal.SIG_DFL)


def test_a_program_that_runs_itself_in_its_workers_ends(tmp_path: Path):
    program = tmp_path / "unguarded.py"
    program.write_text(UNGUARDED)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, program], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert "expected the script's work below `if __name__ == '__main__':`" in done.stderr
    assert "WorkerLostError: a worker ended in each of 3 tries" in done.stderr


@pytest.mark.parametrize("engine", ENGINES)
def test_what_pieces_report_arrives_before_their_ends(engine: str):
    seen = list[str]()
    with start_workers(Engine.parse(engine), 2) as workers:
        monitor = ProgressMonitor(lambda progress: seen.append(str(progress)))
        run_pieces(
            report_steps, {"2": 2, "3": 3}, workers, lambda name, _: seen.append(name), monitor
        )
    for number in (2, 3):
        steps = [f"piece {number} {step + 1} of {number}" for step in range(number)]
        assert [line for line in seen if line in {*steps, str(number)}] == [*steps, str(number)]


def test_a_piece_of_canceled_work_is_left_as_by_an_exception(tmp_path: Path):
    seen = list[Progress]()
    monitor = ProgressMonitor(seen.append, lambda: len(seen) == 2)
    pieces = {"first": str(tmp_path), "second": str(tmp_path)}
    with (
        pytest.raises(CancelledError),
        start_workers(Engine.parse("local:2"), 2) as workers,
    ):
        run_pieces(wait_for_end, pieces, workers, lambda *_: None, monitor)
    assert len(list(tmp_path.iterdir())) == 2
