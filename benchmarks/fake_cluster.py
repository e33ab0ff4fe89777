"""A cluster of three hosts on one machine, on which the engines Dask and Ray are tried.

    sudo .venv/bin/python benchmarks/fake_cluster.py --kinds dask ray --json fake_cluster.json

Each host is a network namespace of Linux with its own address, host name and /tmp; a bridge joins
them. `getup bench rise` runs on one of them, and its figures are compared with those of one process
of this machine: first undisturbed, then with all processes of one host killed while rises are
running, last with another version of the program on two hosts, which has to be refused.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from json import dumps, loads
from pathlib import Path
from typing import Any, Literal

import tyro

from humanoid_getup.benchmarks.bench_result import WALL_TIMES

REPOSITORY = Path(__file__).resolve().parent.parent
PROGRAMS = Path(sys.executable).parent
HOSTS = 3
NETWORK = "10.77.0"
BRIDGE = "getup-bridge"
PORTS = {"dask": 8786, "ray": 6379}
RAY = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # A head whose address others reach requires a token.
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": "0123456789abcdef" * 4,
}
START, LONGEST, POLL = 90.0, 400.0, 0.2  # s
LINES_AT_KILL = 3  # of the ledger: its recipe and two rises
ENTER = 'hostname "$1" && mount --bind "$2" /tmp && shift 2 && exec "$@"'
COUNT = """
import sys
from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.run_pieces import start_workers
with start_workers(Engine.parse(*sys.argv[1:]), 1) as workers:
    print(workers.count)
"""

Kind = Literal["dask", "ray"]


@dataclass(frozen=True, kw_only=True)
class FakeHost:
    """A network namespace that stands for a host."""

    name: str
    address: str
    folder: Path
    """Its /tmp."""

    def start(self, *words: str | Path, path: str = str(REPOSITORY)) -> subprocess.Popen[str]:
        """Start a program on the host, with folders on which Python finds modules."""
        enter = ("ip", "netns", "exec", self.name, "unshare", "--uts", "sh", "-c", ENTER, "sh")
        return _start(*enter, self.name, self.folder, *words, path=path)

    def kill(self) -> int:
        """Kill all its processes; return their number."""
        listed = _ip("netns", "pids", self.name).split()
        for number in map(int, listed):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        return len(listed)


def _start(*words: str | Path, path: str = str(REPOSITORY)) -> subprocess.Popen[str]:
    environment = os.environ | RAY | {"PYTHONPATH": path}
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*map(str, words)], env=environment, cwd="/", **pipes)


def _ip(*words: str) -> str:
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True).stdout


@contextmanager
def fake_hosts(folder: Path, count: int = HOSTS) -> Iterator[list[FakeHost]]:
    """Make hosts and the network between them; remove both and end all processes at the end."""
    with ExitStack() as stack:
        _ip("link", "add", BRIDGE, "type", "bridge")
        stack.callback(_ip, "link", "del", BRIDGE)
        _ip("link", "set", BRIDGE, "up")
        yield [stack.enter_context(_fake_host(folder, number + 1)) for number in range(count)]


@contextmanager
def _fake_host(folder: Path, number: int) -> Iterator[FakeHost]:
    """Make a host and its link to the bridge."""
    name, link = f"getup-{number}", f"getup-link-{number}"
    host = FakeHost(name=name, address=f"{NETWORK}.{number}", folder=folder / name)
    host.folder.mkdir()
    _ip("netns", "add", name)
    try:
        _ip("link", "add", link, "type", "veth", "peer", "name", "eth0", "netns", name)
        _ip("link", "set", link, "master", BRIDGE, "up")
        _ip("-n", name, "address", "add", f"{host.address}/24", "dev", "eth0")
        for device in ("eth0", "lo"):
            _ip("-n", name, "link", "set", device, "up")
        yield host
    finally:
        while host.kill():
            time.sleep(POLL)
        _ip("netns", "del", name)


@contextmanager
def fake_cluster(
    kind: Kind, hosts: Sequence[FakeHost], paths: Sequence[str] = (str(REPOSITORY),) * HOSTS
) -> Iterator[str]:
    """Start a scheduler on the first host and a worker on each; give the address.

    Args:
        kind: What runs there.
        hosts: The hosts.
        paths: Where the worker of each finds its modules.
    """
    head = hosts[0]
    address = f"{head.address}:{PORTS[kind]}"
    start = _start_dask if kind == "dask" else _start_ray
    if kind == "dask":
        address = f"tcp://{address}"
    try:
        start(hosts, address, paths)
        _wait(lambda: _count(head, kind, address) == len(hosts), START, "workers of all hosts")
        yield address
    finally:
        for host in hosts:
            while host.kill():
                time.sleep(POLL)


def _start_dask(hosts: Sequence[FakeHost], address: str, paths: Sequence[str]) -> None:
    dask = PROGRAMS / "dask"
    port = str(PORTS["dask"])
    hosts[0].start(dask, "scheduler", "--host", hosts[0].address, "--port", port, "--no-dashboard")
    for host, path in zip(hosts, paths, strict=True):
        own = ("--host", host.address, "--nthreads", "1", "--no-dashboard")
        host.start(dask, "worker", address, *own, path=path)


def _start_ray(hosts: Sequence[FakeHost], address: str, paths: Sequence[str]) -> None:
    own = ("--num-cpus", "1", "--object-store-memory", "100000000", "--block")
    for host, path in zip(hosts, paths, strict=True):
        first = host is hosts[0]
        head = ("--head", "--port", str(PORTS["ray"]), "--include-dashboard", "false")
        role = head if first else ("--address", address)
        host.start(
            PROGRAMS / "ray", "start", *role, "--node-ip-address", host.address, *own, path=path
        )
        if first:
            _wait(lambda: _count(hosts[0], "ray", address) == 1, START, "the head of Ray")


def _count(host: FakeHost, kind: Kind, address: str) -> int:
    """Count the workers that a program on a host finds; 0 if it finds no cluster."""
    done = host.start(sys.executable, "-c", COUNT, kind, address).communicate()[0].split()
    return int(done[-1]) if done else 0


def _wait(is_there: Callable[[], bool], longest: float, what: str) -> None:
    end = time.monotonic() + longest
    while not is_there():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {longest:g} s for {what}")
        time.sleep(POLL)


def read_rises(file: Path) -> list[dict[str, Any]]:
    """Read the rises of a benchmark without wall times."""
    rises = loads(file.read_text("utf-8"))["rises"]
    return [{key: one[key] for key in one if key not in WALL_TIMES} for one in rises]


def list_words(n: int, engine: str, file: Path) -> list[str | Path]:
    """List the words of a benchmark's command."""
    quick = ("--n", str(n), "--no-planning", "--no-filtering", "--seed", "4")
    kept = ("--ledger", file.with_suffix(".jsonl"), "--json", file)
    return [PROGRAMS / "getup", "bench", "rise", *quick, *kept, "--engine", *engine.split()]


def finish(process: subprocess.Popen[str]) -> None:
    """Wait for a benchmark.

    Raises:
        RuntimeError: if it fails.
    """
    error = process.communicate(timeout=LONGEST)[1]
    if process.returncode not in (0, 1):
        raise RuntimeError(f"exit code {process.returncode}: {error[-2000:]}")


def try_engine(kind: Kind, hosts: Sequence[FakeHost], folder: Path, n: int) -> dict[str, Any]:
    """Try an engine; return what was found."""
    few, many = folder / f"{kind}_few.json", folder / f"{kind}_many.json"
    with fake_cluster(kind, hosts) as address:
        engine = f"{kind} --address {address}"
        began = time.monotonic()
        finish(hosts[0].start(*list_words(1, engine, few)))
        took = time.monotonic() - began
        running = hosts[0].start(*list_words(n, engine, many))
        ledger = many.with_suffix(".jsonl")
        _wait(lambda: _count_lines(ledger) >= LINES_AT_KILL, LONGEST, "the first rises")
        before, killed = _count_lines(ledger) - 1, hosts[-1].kill()
        finish(running)
    found = {
        "rises": len(read_rises(few)),
        "same": read_rises(few) == read_rises(folder / "here_few.json"),
        "wall_s": round(took, 1),
        "rises_with_kill": len(read_rises(many)),
        "finished_before_kill": before,
        "processes_killed": killed,
        "same_with_kill": read_rises(many) == read_rises(folder / "here_many.json"),
    }
    return found | {"refused": try_other_version(kind, hosts, folder, n)}


def _count_lines(file: Path) -> int:
    return len(file.read_text("utf-8").splitlines()) if file.exists() else 0


def try_other_version(kind: Kind, hosts: Sequence[FakeHost], folder: Path, n: int) -> list[str]:
    """Run with another program on all hosts but the first; return the lines of the error."""
    copy = folder / f"{kind}_copy"
    shutil.copytree(REPOSITORY / "humanoid_getup", copy / "humanoid_getup")
    with (copy / "humanoid_getup" / "engines" / "engine.py").open("a", encoding="utf-8") as file:
        file.write("# another comment\n")
    other = os.pathsep.join([str(copy), str(REPOSITORY)])
    paths = [str(REPOSITORY), *[other] * (len(hosts) - 1)]
    with fake_cluster(kind, hosts, paths) as address:
        words = list_words(n, f"{kind} --address {address}", folder / f"{kind}_other.json")
        process = hosts[0].start(*words)
        error = process.communicate(timeout=LONGEST)[1]
    return [f"exit code {process.returncode}", *error.strip().splitlines()]


def main(
    *, kinds: tuple[Kind, ...] = ("dask", "ray"), n: int = 4, json: Path | None = None
) -> None:
    """Try engines on three hosts.

    Args:
        kinds: Engines.
        n: Falls of each class in the run in which a host is killed.
        json: File for the results.
    """
    with tempfile.TemporaryDirectory(dir="/var/tmp") as name, fake_hosts(Path(name)) as hosts:
        folder = Path(name)
        for file, count in {"here_few": 1, "here_many": n}.items():
            finish(_start(*list_words(count, "local:1", folder / f"{file}.json")))
        cases = {kind: try_engine(kind, hosts, folder, n) for kind in kinds}
    text = dumps({"name": "fake_cluster", "hosts": HOSTS, "cases": cases}, indent=1)
    print(text)
    if json:
        json.write_text(text + "\n", "utf-8")
    if not all(case["same"] and case["same_with_kill"] for case in cases.values()):
        raise SystemExit("the figures of a cluster differ")


if __name__ == "__main__":
    tyro.cli(main)
