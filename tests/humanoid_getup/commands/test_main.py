"""`getup` as a program: fast to start, clear when it cannot continue, quiet when it is stopped."""

import errno
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from subprocess import PIPE
from typing import Any

import pytest
from nonempty import nonempty
from run_getup import Run

from drivers.errors import DriverError
from humanoid_getup.commands import command_line as commands
from humanoid_getup.commands.command_table import COMMANDS
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.main import SIGNALS, main


def getup(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run `getup` in a process of its own."""
    command = [sys.executable, "-m", "humanoid_getup.commands.main", *arguments]
    return subprocess.run(
        command, **{"stdout": PIPE, **options}, stderr=PIPE, text=True, check=False
    )


def test_the_version_is_printed(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out == f"getup {version('humanoid-getup')}\n"


UNREAD = """
expected a command first: getup --help
motions | expected a command first: getup motions --help
--version extra | unknown argument 'extra': see getup --help
ryse | unknown command 'ryse', expected rise? see getup --help
motions fly | unknown command 'fly', see getup motions --help
--verison | unknown option '--verison', expected --version? see getup --help
motions --hepl | unknown option '--hepl', expected --help? see getup motions --help
robots chek | unknown command 'chek', expected check? see getup robots --help
rise --from | --from has no value, expected one: see getup rise --help
rise --balance yes | unknown argument 'yes': see getup rise --help
run robust --body arms=2 | unknown option '--body', which getup rise, getup play, getup sit, \
getup hold or getup fall has: see getup run --help
run | NAME|FILE is missing: see getup run --help
robots import a.xml --feet 2 | --out DIR is missing; unknown option '--feet': see getup robots \
import --help
"""


@pytest.mark.parametrize("columns", ["30", "200"])
def test_what_cannot_be_read_is_named_in_a_line(
    run: Run, monkeypatch: pytest.MonkeyPatch, columns: str
):
    monkeypatch.setenv("COLUMNS", columns)
    for line in nonempty(UNREAD.replace("\\\n", "").strip().splitlines()):
        words, _, message = line.rpartition(" | ")
        assert run(*words.split()) == (2, "", f"getup: {message}\n")


def test_help_lists_every_command_of_a_group(capsys: pytest.CaptureFixture[str]):
    for group in ("", *(name for name in COMMANDS if not commands.is_command(name))):
        with pytest.raises(SystemExit) as left:
            main([*group.split(), "--help"])
        assert left.value.code == 0
        lines = capsys.readouterr().out.splitlines()
        listed = [f"{group} {line.split()[0]}".strip() for line in lines if line[:2] == "  "]
        own = [name for name in COMMANDS if name.rpartition(" ")[0] == group]
        assert sorted(listed) == sorted(own)


@pytest.mark.parametrize(
    ("refusal", "times"),
    [
        (signal.SIGINT, 2),
        pytest.param(signal.SIGTERM, 1, marks=pytest.mark.slow),
    ],
)
def test_a_program_asked_to_stop_leaves_with_130_and_the_flight_log_alone(
    refusal: int, times: int, tmp_path: Path
):
    command = [sys.executable, "-m", "humanoid_getup.commands.main", "play", "supine_sit_up_gentle"]
    command += ["--realtime", "--out", str(tmp_path / "out")]
    log = tmp_path / "out" / "flight.mcap"
    with subprocess.Popen(command, stderr=PIPE, text=True) as process:
        while not log.exists() and process.poll() is None:
            time.sleep(0.01)  # the log begins with the first of eight seconds of motion
        for _ in range(times):  # a second signal must not interrupt switching torque off
            process.send_signal(refusal)
        _, error = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert error.splitlines()[-1] == "getup: interrupted"
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [log]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [("robots",), ("robots", "--json", "-")])
def test_a_full_disk_is_told_in_one_line_and_a_closed_pipe_not_at_all(arguments: tuple[str, ...]):
    with Path("/dev/full").open("w") as full:
        done = getup(*arguments, stdout=full)
    expected = "getup: standard output: No space left on device\n"
    assert (done.returncode, done.stderr) == (2, expected)
    reader, writer = os.pipe()
    os.close(reader)
    done = getup(*arguments, stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


HEAVY = {"cma", "scipy.stats", "matplotlib.pyplot", "torch", "onnxruntime"}
LIGHT = ["--help", "motions --help"]
HELP = [f"{name} --help" for name in COMMANDS if commands.is_command(name)]
LOADED = """
import contextlib, io, json, sys
from humanoid_getup.commands.main import main
loaded = {"": list(sys.modules)}
for command in json.load(sys.stdin):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()) as said:
        main(command.split())
    loaded[command] = [*sys.modules, said.getvalue()]
json.dump(loaded, sys.stdout)
"""


def test_every_command_has_a_function_and_explains_itself_without_numpy():
    """Run in one process, one after the other; each has what was loaded so far."""
    lines = json.dumps([*LIGHT, "robots", "motions list", *HELP])
    done = subprocess.run(
        [sys.executable, "-c", LOADED], input=lines, stdout=PIPE, text=True, check=True
    )
    loaded = {line: set(modules) for line, modules in json.loads(done.stdout).items()}
    assert {"tyro", "rich", "numpy"} & loaded[""] == set(), "signals are handled before"
    for command in LIGHT:
        assert {*HEAVY, "mujoco", "numpy"} & loaded[command] == set(), command
    for command in ("robots", "motions list"):
        assert "numpy" in loaded[command]
        assert HEAVY & loaded[command] == set(), command
    for line in HELP:
        usage = f"usage: getup {line.removesuffix('--help')}"
        assert any(each.startswith(usage) for each in loaded[line]), line


@pytest.fixture
def own_signals() -> Iterator[None]:
    """Leave the handlers of signals as they were."""
    before = {getattr(signal, name): signal.getsignal(getattr(signal, name)) for name in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("own_signals")
@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (ImportError("initialization failed"), 130, "interrupted"),
        (BadInputError("no film strip: no GL to render with"), 130, "interrupted"),
        (OSError(27, "File too large", "report.json"), 2, "report.json: File too large"),
        (DriverError("torque may be on"), 3, "torque may be on"),
    ],
)
def test_what_a_library_makes_of_an_interrupt_is_one(
    run: Run, monkeypatch: pytest.MonkeyPatch, error: Exception, code: int, line: str
):
    def fail(_: object) -> None:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        raise error

    monkeypatch.setattr(commands, "parse", fail)
    assert run("robots") == (code, "", f"getup: {line}\n")


def test_too_little_memory_is_told_in_one_line(run: Run, monkeypatch: pytest.MonkeyPatch):
    for error in (
        MemoryError(),
        ImportError("in numpy:\na.so: failed to map segment from shared object\n"),
        RuntimeError("can't start new thread"),
        OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)),
        BadInputError("Could not allocate memory"),
    ):
        for outer in (None, TypeError("no module")):

            def fail(_: object, error: Exception = error, outer: Exception | None = outer) -> None:
                raise outer or error from outer and error

            monkeypatch.setattr(commands, "parse", fail)
            code, out, line = run("robots")
            assert (code, out, line.count("\n")) == (1, "", 1)
            told = f"getup: too little memory, or too few threads ({error!r}), expected more"
            assert line.startswith(told)


def test_a_process_with_little_memory_says_so(tmp_path: Path):
    """Enough for Python and its libraries, and not for a model in them."""
    limit = (500_000_000, 500_000_000)
    found = getup(
        *("rise", "--from", "prone", "--out", str(tmp_path / "out")),
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, limit),
        timeout=60.0,
    )
    assert (found.returncode, found.stderr.count("\n")) == (1, 1)
    assert found.stderr.startswith("getup: too little memory")


@pytest.mark.usefixtures("own_signals")
def test_an_interrupt_that_an_import_swallows_stops_the_program_before_it_works(
    run: Run, monkeypatch: pytest.MonkeyPatch
):
    def load(_: object) -> Callable[[], int]:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        return lambda: 0

    monkeypatch.setattr(commands.Invocation, "load", load)
    assert run("robots") == (130, "", "getup: interrupted\n")


def test_an_error_of_no_file_and_no_output_is_its_own_text(
    run: Run, monkeypatch: pytest.MonkeyPatch
):
    for given in (("no folder",), (errno.ENOENT, "no folder")):

        def fail(given: tuple[Any, ...] = given) -> None:
            raise OSError(*given)

        monkeypatch.setattr(commands.Invocation, "load", lambda _, fail=fail: fail)
        assert run("robots") == (2, "", "getup: no folder\n")


def test_completions_know_the_options_of_every_command(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["--tyro-print-completion", "bash"])
    script = capsys.readouterr().out
    for option in ("--torque-limit", "--generations", "--weak-servo"):
        assert option in script


def test_without_a_gl_there_is_no_film_strip_and_a_wrong_one_is_named(tmp_path: Path):
    words = ("motions", "show", "squat_to_stand", "--picture", str(tmp_path / "s.png"))
    for gl, told in (
        ("crayon", "MUJOCO_GL: crayon, expected egl"),
        ("disable", "getup: no film strip: no GL to render with (MUJOCO_GL=disable)"),
    ):
        done = getup(*words, env={**os.environ, "MUJOCO_GL": gl})
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert told in done.stderr
        assert list(tmp_path.iterdir()) == []
