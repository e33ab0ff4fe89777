"""Pieces give the same results wherever they are done, and a lost worker costs one of them."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import partial
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest
from counted_work import (
    TRACE,
    LoadedSquares,
    die,
    die_once,
    fail_stubbornly,
    name_process,
    refuse,
    report_until_seen,
    square,
    square_in_a_child,
    square_slowly,
    wait_for_end,
)
from waiting import wait_until

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.executor import (
    LocalProcesses,
    ThisProcess,
    do_pieces,
    make_executor,
)
from humanoid_getup.engines.versions import Versions, checked, hash_folder
from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from robots import load_robot

PROGRAM = """
import signal, sys
from counted_work import compute_for_ever
from humanoid_getup.engines.executor import do_pieces, make_executor

signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background, too
if __name__ == "__main__":
    with make_executor("local:2") as executor:
        do_pieces(compute_for_ever, dict.fromkeys(sys.argv[2], sys.argv[1]), executor)
"""


@pytest.fixture(scope="module", params=["local:2", pytest.param("dask:2", marks=pytest.mark.scale)])
def workers(request: pytest.FixtureRequest) -> Iterator[Executor]:
    """Two workers for all tests that leave no piece behind."""
    if request.param != "local:2":
        pytest.importorskip("distributed")
    with make_executor(request.param) as executor:
        yield executor


def do(executor: Executor, work: Callable[[Any], Any], pieces: list[Any], **options: Any):
    """Do pieces; return their results in the order of the pieces."""
    named = {str(number): piece for number, piece in enumerate(pieces)}
    return list(do_pieces(work, named, executor, **options).values())


def run(engine: str, work: Callable[[Any], Any], pieces: list[Any], **options: Any) -> list[Any]:
    with make_executor(engine, pieces=len(pieces)) as executor:
        return do(executor, work, pieces, **options)


def test_results_do_not_depend_on_the_workers_and_their_order(workers: Executor):
    for executor in (workers, ThisProcess()):
        assert do(executor, square_slowly, [*range(11)]) == [n * n for n in range(11)]
        assert do(executor, square, []) == []


def test_a_name_says_the_kind_and_the_workers():
    found = [Engine.parse(name) for name in ("local", "local:3", "dask:2", "slurm:4")]
    expected = [("local", None), ("local", 3), ("dask", 2), ("slurm", 4)]
    assert [(each.kind, each.workers) for each in found] == expected


@pytest.mark.parametrize(
    ("name", "address", "message"),
    [
        ("cloud", "", "engine is 'cloud', expected local, dask or slurm"),
        ("local:" + 5000 * "9", "", "engine is 'local:9.*', expected local, dask or slurm"),
        ("local:0", "", "expected 1 to 256 workers"),
        ("local:", "", "engine is 'local:', expected local"),
        ("local", "10.0.0.1:8786", "expected none with engine local"),
        ("dask:4", "10.0.0.1:8786", "expected dask alone"),
    ],
)
def test_a_name_of_no_engine_is_refused(name: str, address: str, message: str):
    with pytest.raises(ValueError, match=message):
        Engine.parse(name, address)


def test_a_few_pieces_need_no_process_more():
    assert Engine.parse("local").choose_workers(3) == 1
    assert Engine.parse("local").choose_workers(10_000) == len(os.sched_getaffinity(0))
    assert Engine.parse("local:4").choose_workers(3) == 3


def test_one_worker_is_this_process_and_two_are_others(workers: Executor):
    assert set(run("local:1", name_process, [0] * 3)) == {os.getpid()}
    others = set(do(workers, name_process, [0] * 8))
    assert os.getpid() not in others
    assert len(others) <= 2


def test_an_error_of_a_piece_is_raised_as_it_is_or_if_it_cannot_travel_as_its_text(workers):
    for executor in (workers, ThisProcess()):
        with pytest.raises(ValueError, match=r"^number is 7, expected another$"):
            do(executor, refuse, [7])
    with pytest.raises(RuntimeError, match="StubbornError: number is 7"):
        do(workers, fail_stubbornly, [7])


def test_a_piece_may_start_processes(workers: Executor):
    assert do(workers, square_in_a_child, [3]) == [9]


def test_work_is_loaded_once_in_a_worker(workers: Executor, tmp_path: Path):
    assert do(workers, LoadedSquares(tmp_path), [*range(9)]) == [n * n for n in range(9)]
    assert len(list(tmp_path.iterdir())) == 2


def test_what_pieces_report_arrives_while_they_are_done(tmp_path: Path):
    monitor = ProgressMonitor(lambda progress: Path(progress.phase).touch())
    for engine in ("local:1", "local:2"):
        files = [str(tmp_path / f"{engine}_{name}") for name in "ab"]
        assert run(engine, report_until_seen, files, monitor=monitor) == [0, 0]


def test_a_worker_that_differs_is_refused_by_what_differs(workers, copied_op3, monkeypatch):
    expected = Versions(program="another", libraries="another", robot="another")
    monkeypatch.setattr(Versions, "find", lambda _: expected)
    work = checked(square, workers, str(copied_op3))
    with pytest.raises(ValueError, match=r"a worker on .* has another program") as problem:
        do(workers, work, [1])
    for field in ("program", "libraries", "robot"):
        assert re.search(rf"{field} \S.* \(expected another\)", str(problem.value))
    assert str(problem.value).isprintable()


def test_a_killed_worker_costs_one_piece(workers: Executor, tmp_path: Path):
    pieces = [(tmp_path, number) for number in range(9)]
    assert do(workers, die_once, pieces) == [n * n for n in range(9)]
    tries = [len((tmp_path / f"{TRACE}_{number}").read_text()) for number in range(9)]
    assert tries[3] == 2
    if isinstance(workers, LocalProcesses):
        assert sum(tries) == 10


def test_a_piece_that_always_ends_its_worker_is_given_up_in_one_line(workers: Executor):
    with pytest.raises(ValueError, match="in each of 3 tries of a piece") as problem:
        do(workers, die, [1])
    assert str(problem.value).isprintable()


@pytest.mark.parametrize("engine", ["local:1", "local:2"])
def test_canceled_work_keeps_what_is_finished_and_does_only_the_rest(engine: str, tmp_path: Path):
    ledger, pieces = Ledger(tmp_path / "ledger.jsonl", {"seed": 0}), [*range(50)]
    expected, seen = [n * n for n in pieces], list[str]()

    def end(name: str, _result: int) -> None:
        seen.append(name)

    monitor, others = ProgressMonitor(cancel=lambda: len(seen) >= 3), active_children()
    with pytest.raises(CancelledError):
        run(engine, square_slowly, pieces, ledger=ledger, ended=end, monitor=monitor)
    assert 3 <= len(seen) < 20
    assert active_children() == others
    again = Ledger.resume(ledger.path, {"seed": 0})
    assert [*again.done] == seen
    again.add(seen[0], 77)  # what the ledger holds is taken
    expected[int(seen[0])] = 77
    assert run("local:1", square, pieces, ledger=again, kind=int) == expected
    assert run(engine, die, pieces, ledger=again) == expected  # nothing is left to do


def test_what_ends_before_an_error_is_kept(tmp_path: Path):
    ledger = Ledger(tmp_path / "ledger.jsonl", {})

    def fail(name: str, _result: int) -> None:
        if name == "1":
            raise EOFError

    with pytest.raises(EOFError):
        run("local:2", square, [1, 2, 3], ledger=ledger, ended=fail)
    assert ledger.done["1"] == 4


def test_a_piece_of_canceled_work_is_left_as_by_an_exception(tmp_path: Path):
    seen = list[Progress]()
    monitor = ProgressMonitor(seen.append, lambda: len(seen) == 2)
    with pytest.raises(CancelledError):
        run("local:2", wait_for_end, [str(tmp_path)] * 2, monitor=monitor)
    assert len(list(tmp_path.iterdir())) == 2


def start(folder: Path, text: str, pieces: str = "ab") -> subprocess.Popen[str]:
    """Start a program whose workers leave their numbers in a folder."""
    folder.mkdir()
    program = folder.with_suffix(".py")
    program.write_text(text)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    words = [sys.executable, str(program), str(folder), pieces]
    return subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True)


def has_two(folder: Path) -> bool:
    return len(list(folder.iterdir())) == 2


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_workers_end_when_their_parent_is_killed_or_interrupted(tmp_path: Path):
    workers = set[int]()
    for message in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
        folder = tmp_path / message.name
        with start(folder, PROGRAM) as process:
            wait_until(partial(has_two, folder))
            process.send_signal(message)
            process.wait()
        workers |= {int(path.name) for path in folder.iterdir()}
    assert len(workers) == 6
    wait_until(lambda: not any(map(is_running, workers)))


def test_a_program_that_runs_itself_in_its_workers_ends(tmp_path: Path):
    text = PROGRAM.replace('if __name__ == "__main__":', "if True:")
    with start(tmp_path / "unguarded", text, "a") as process:
        errors = process.communicate()[1]
    assert process.returncode == 1
    assert "if __name__ == '__main__':" in errors
    assert "ValueError: a worker ended in each of 3 tries" in errors


def test_the_checksum_of_a_robot_is_that_of_its_content(tmp_path: Path):
    source = load_robot("op3").folder
    copy = shutil.copytree(source, tmp_path / "copy")
    (copy / "unfinished").mkdir(exist_ok=True)
    (copy / "unfinished" / "search.jsonl").write_text("{}")
    assert hash_folder(copy) == hash_folder(source)
    (copy / "robot.toml").write_text((copy / "robot.toml").read_text() + "\n")
    assert hash_folder(copy) != hash_folder(source)


@pytest.mark.scale
@pytest.mark.parametrize("scheme", ["tcp", "tls", "ucx", "bar"])
def test_a_cluster_that_does_not_answer_is_refused_in_one_line(scheme: str):
    """Also by what is not set up for it here: certificates, or a network card."""
    pytest.importorskip("distributed")
    with (
        pytest.raises(ValueError, match="answers at") as problem,
        make_executor("dask", f"{scheme}://127.0.0.1:1"),
    ):
        pass
    assert str(problem.value).isprintable()


@pytest.mark.scale
def test_a_cluster_that_is_running_does_pieces():
    distributed = pytest.importorskip("distributed")
    options = {"threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(n_workers=2, **options) as cluster,
        make_executor("dask", cluster.scheduler_address) as executor,
    ):
        assert do_pieces(square, {"a": 2, "b": 3}, executor) == {"a": 4, "b": 9}


@pytest.mark.scale
def test_slurm_is_named_where_there_is_none(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("dask_jobqueue")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ValueError, match="no `sbatch`"), make_executor("slurm:4"):
        pass
