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
from run_getup import Run

from drivers.errors import DriverError
from humanoid_getup.commands import command_line as commands
from humanoid_getup.commands.command_table import COMMANDS
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.main import SIGNALS, main

MOTION = "squat_to_stand"


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


@pytest.mark.parametrize("columns", ["30", "200"])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("rise --from", "--from has no value, expected one: see getup rise --help"),
        ("rise --form supine", "unknown option '--form', expected --from: see getup rise --help"),
        ("rise --balance yes", "unknown argument 'yes': see getup rise --help"),
        (
            "run robust --body arms=2",
            "unknown option '--body', which getup rise, getup play, getup sit, getup hold or "
            "getup fall has: see getup run --help",
        ),
        ("motions retarget", "--robot STR is missing: see getup motions retarget --help"),
        ("run", "NAME|FILE is missing: see getup run --help"),
        (
            "robots import a.xml --feet 2",
            "--out DIR is missing; unknown option '--feet': see getup robots import --help",
        ),
    ],
)
def test_what_cannot_be_read_is_named_in_a_line(
    run: Run, monkeypatch: pytest.MonkeyPatch, arguments: str, message: str, columns: str
):
    monkeypatch.setenv("COLUMNS", columns)
    assert run(*arguments.split()) == (2, "", f"getup: {message}\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "expected a command first: getup --help"),
        ("motions", "expected a command first: getup motions --help"),
        ("--version extra", "unknown argument 'extra': see getup --help"),
        ("ryse", "unknown command 'ryse', expected rise? see getup --help"),
        ("motions fly", "unknown command 'fly', see getup motions --help"),
        ("--verison", "unknown option '--verison', expected --version? see getup --help"),
        ("motions --hepl", "unknown option '--hepl', expected --help? see getup motions --help"),
        ("robots chek", "unknown command 'chek', expected check? see getup robots --help"),
    ],
)
def test_a_missing_or_unknown_command_is_reported_in_a_line(run: Run, arguments: str, message: str):
    assert run(*arguments.split()) == (2, "", f"getup: {message}\n")


@pytest.mark.parametrize(
    "group", ["", *(name for name in COMMANDS if not commands.is_command(name))]
)
def test_help_lists_every_command_of_a_group(group: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as left:
        main([*group.split(), "--help"])
    assert left.value.code == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line[:2] == "  "]
    own = [name for name in COMMANDS if name.rpartition(" ")[0] == group]
    assert sorted(f"{group} {name}".strip() for name in listed) == sorted(own)


@pytest.mark.parametrize(
    ("refusal", "times"),
    [
        (signal.SIGINT, 2),
        (signal.SIGTERM, 1),
        pytest.param(signal.SIGINT, 1, marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, 2, marks=pytest.mark.slow),
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
@pytest.mark.parametrize("arguments", [("robots",), ("robots", "--json", "-"), ("motions", "list")])
def test_a_full_disk_is_reported_in_one_line(arguments: tuple[str, ...]):
    with Path("/dev/full").open("w") as full:
        done = getup(*arguments, stdout=full)
    assert done.returncode == 2
    assert done.stderr == "getup: standard output: No space left on device\n"


@pytest.mark.parametrize("arguments", [("robots",), ("motions", "list", "--json", "-")])
def test_a_closed_pipe_ends_the_program_quietly(arguments: tuple[str, ...]):
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


@pytest.fixture(scope="module")
def loaded() -> dict[str, set[str]]:
    """The modules loaded after each of some commands, run in one process; and what it said."""
    commands = [*LIGHT, "robots", "motions list", *HELP]
    done = subprocess.run(
        [sys.executable, "-c", LOADED],
        input=json.dumps(commands),
        stdout=PIPE,
        text=True,
        check=True,
    )
    return {command: set(modules) for command, modules in json.loads(done.stdout).items()}


def test_every_command_has_a_function_and_explains_itself_without_numpy(
    loaded: dict[str, set[str]],
):
    for command in LIGHT:
        assert {*HEAVY, "mujoco", "numpy"} & loaded[command] == set(), command
    for command in ("robots", "motions list"):
        assert "numpy" in loaded[command]
        assert HEAVY & loaded[command] == set(), command
    for name in COMMANDS:
        if commands.is_command(name):
            usage = f"usage: getup {name} "
            assert any(each.startswith(usage) for each in loaded[f"{name} --help"]), name


def test_signals_are_handled_before_anything_is_loaded(loaded: dict[str, set[str]]):
    assert {"tyro", "rich", "numpy"} & loaded[""] == set()


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
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_a_library_makes_of_an_interrupt_is_one(
    run: Run, monkeypatch: pytest.MonkeyPatch, number: int, error: Exception, code: int, line: str
):
    def fail(_: object) -> None:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        raise error

    monkeypatch.setattr(commands, "parse", fail)
    assert run("robots") == (code, "", f"getup: {line}\n")


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ImportError("in numpy:\na.so: failed to map segment from shared object\n"),
        RuntimeError("can't start new thread"),
        OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)),
        BadInputError("Could not allocate memory"),
    ],
)
@pytest.mark.parametrize("outer", [None, TypeError("no module")])
def test_too_little_memory_is_told_in_one_line(
    run: Run, monkeypatch: pytest.MonkeyPatch, error: Exception, outer: Exception | None
):
    def fail(_: object) -> None:
        raise outer or error from outer and error

    monkeypatch.setattr(commands, "parse", fail)
    code, out, line = run("robots")
    assert (code, out, line.count("\n")) == (1, "", 1)
    assert line.startswith(
        f"getup: too little memory, or too few threads ({error!r}), expected more"
    )


def test_a_process_with_little_memory_says_so(tmp_path: Path):
    """Enough for Python and its libraries, and not for a model in them."""
    limit = (600_000_000, 600_000_000)
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


@pytest.mark.parametrize("number", [None, errno.ENOENT])
def test_an_error_of_no_file_and_no_output_is_its_own_text(
    run: Run, monkeypatch: pytest.MonkeyPatch, number: int | None
):
    def fail() -> None:
        raise OSError("no folder") if number is None else OSError(number, "no folder")

    monkeypatch.setattr(commands.Invocation, "load", lambda _: fail)
    assert run("robots") == (2, "", "getup: no folder\n")


def test_completions_know_the_options_of_every_command(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        main(["--tyro-print-completion", "bash"])
    script = capsys.readouterr().out
    for option in ("--torque-limit", "--generations", "--weak-servo"):
        assert option in script


def test_a_gl_that_does_not_exist_is_named():
    done = getup("robots", env={**os.environ, "MUJOCO_GL": "crayon"})
    assert done.returncode == 2
    assert "MUJOCO_GL: crayon, expected egl" in done.stderr
    assert done.stderr.count("\n") == 1


def test_without_a_gl_there_is_no_film_strip(tmp_path: Path):
    environment = {**os.environ, "MUJOCO_GL": "disable"}
    done = getup("motions", "show", MOTION, "--picture", str(tmp_path / "s.png"), env=environment)
    assert done.returncode == 2
    assert done.stderr.startswith("getup: no film strip: no GL to render with (MUJOCO_GL=disable)")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
