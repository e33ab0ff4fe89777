"""A cluster of three hosts on one machine, on which the engines Dask, Ray and Slurm are tried.

    sudo .venv/bin/python benchmarks/fake_cluster.py --kinds dask ray --json fake_cluster.json

Each host is a network namespace of Linux with its own address, host name and /tmp; a bridge joins
them. `getup bench rise` runs on one of them, and its figures are compared with those of one process
of this machine: first undisturbed, then with all processes of one host killed while rises are
running, last with another version of the program on two hosts, which has to be refused (not with
Slurm, whose jobs have the environment of the program that submits them). Slurm is Debian's:
`apt-get install slurm-wlm munge`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from json import dumps, loads
from pathlib import Path
from typing import Any, Literal

import tyro
from fake_hosts import HOSTS, POLL, REPOSITORY, FakeHost, fake_hosts, start

from humanoid_getup.benchmarks.bench_result import WALL_TIMES

PROGRAMS = Path(sys.executable).parent
DASK_PORT, RAY_PORT = "8786", "6379"
RAY = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # A head whose address others reach requires a token.
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": "0123456789abcdef" * 4,
}
SLURM = """
ClusterName=getup
SlurmctldHost={head.name}({head.address})
SlurmUser=root
AuthInfo=socket={folder}/munge.socket
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
SlurmdTimeout=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
{nodes}
PartitionName=all Nodes=ALL Default=YES State=UP
"""
SLURM_NODE = "NodeName={host.name} NodeAddr={host.address} CPUs=1 RealMemory=8000"
START, LONGEST = 90.0, 400.0  # s
LINES_AT_KILL = 3  # of the ledger: its recipe and two rises
COUNT = """
import sys
from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.run_pieces import start_workers
with start_workers(Engine.parse(*sys.argv[1:]), 1) as workers:
    print(workers.count)
"""

Kind = Literal["dask", "ray", "slurm"]


@contextmanager
def fake_cluster(
    kind: Kind, hosts: Sequence[FakeHost], paths: Sequence[str] = (str(REPOSITORY),) * HOSTS
) -> Iterator[str]:
    """Start a scheduler on the first host and a worker on each; give the engine.

    Args:
        kind: What runs there.
        hosts: The hosts.
        paths: Where the worker of each finds its modules.
    """
    starts = {"dask": _start_dask, "ray": _start_ray, "slurm": _start_slurm}
    try:
        yield starts[kind](hosts, paths)
    finally:
        for host in hosts:
            while host.kill():
                time.sleep(POLL)


def _start_dask(hosts: Sequence[FakeHost], paths: Sequence[str]) -> str:
    head, dask = hosts[0], PROGRAMS / "dask"
    address = f"tcp://{head.address}:{DASK_PORT}"
    head.serve(dask, "scheduler", "--host", head.address, "--port", DASK_PORT, "--no-dashboard")
    for host, path in zip(hosts, paths, strict=True):
        own = ("--host", host.address, "--nthreads", "1", "--no-dashboard")
        host.serve(dask, "worker", address, *own, path=path)
    return _wait_for_workers(hosts, len(hosts), f"dask --address {address}")


def _start_ray(hosts: Sequence[FakeHost], paths: Sequence[str]) -> str:
    address = f"{hosts[0].address}:{RAY_PORT}"
    engine = f"ray --address {address}"
    own = ("--num-cpus", "1", "--object-store-memory", "100000000", "--block")
    for host, path in zip(hosts, paths, strict=True):
        first = host is hosts[0]
        head = ("--head", "--port", RAY_PORT, "--include-dashboard", "false")
        role = head if first else ("--address", address)
        host.serve(
            PROGRAMS / "ray", "start", *role, "--node-ip-address", host.address, *own, path=path
        )
        if first:
            _wait_for_workers(hosts, 1, engine)
    return _wait_for_workers(hosts, len(hosts), engine)


def _start_slurm(hosts: Sequence[FakeHost], _paths: Sequence[str]) -> str:
    """Start Slurm with a node on each host; its jobs find modules where the program does."""
    head, folder = hosts[0], hosts[0].folder.parent / "slurm"
    (folder / "state").mkdir(parents=True, exist_ok=True)
    key, settings = folder / "munge.key", folder / "slurm.conf"
    # Version 2 of control groups needs /sys/fs/cgroup, which is empty in `ip netns exec`.
    (folder / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\n")
    key.write_bytes(os.urandom(128))
    key.chmod(0o400)
    nodes = "\n".join(SLURM_NODE.format(host=host) for host in hosts)
    settings.write_text(SLURM.format(head=head, folder=folder, nodes=nodes))
    os.environ |= {
        "SLURM_CONF": str(settings),
        "DASK_JOBQUEUE__SLURM__INTERFACE": "eth0",
        "DASK_JOBQUEUE__SLURM__LOG_DIRECTORY": str(folder),
    }
    files = {"--key-file": key} | {
        f"--{what}": folder / f"munge.{what}" for what in ("socket", "pid-file", "seed-file")
    }
    options = [word for name, file in files.items() for word in (name, file)]
    head.serve("munged", "--foreground", "--force", *options)
    _wait((folder / "munge.socket").exists, START, "munge")
    head.serve("slurmctld", "-D")
    for host in hosts:
        (folder / host.name).mkdir(exist_ok=True)
        host.serve("slurmd", "-D", "-N", host.name)
    _wait(lambda: _count_nodes(head) == len(hosts), START, "nodes of Slurm")
    return f"slurm:{len(hosts)}"


def _count_nodes(host: FakeHost) -> int:
    """Count the nodes of Slurm that wait for a job."""
    idle = host.start("sinfo", "--noheader", "--Node", "--states", "idle")
    return len(idle.communicate()[0].splitlines())


def _wait_for_workers(hosts: Sequence[FakeHost], count: int, engine: str) -> str:
    """Wait until a program on the first host finds so many workers; return the engine."""
    _wait(lambda: _count_workers(hosts[0], engine) == count, START, f"{count} workers of {engine}")
    return engine


def _count_workers(host: FakeHost, engine: str) -> int:
    """Count the workers that a program on a host finds; 0 if it finds no cluster."""
    kind, _, address = engine.split()
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
    with fake_cluster(kind, hosts) as engine:
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
    if kind == "slurm":
        return found
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
    with fake_cluster(kind, hosts, paths) as engine:
        words = list_words(n, engine, folder / f"{kind}_other.json")
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
    os.environ |= RAY
    with tempfile.TemporaryDirectory(dir="/var/tmp") as name, fake_hosts(Path(name)) as hosts:
        folder = Path(name)
        for file, count in {"here_few": 1, "here_many": n}.items():
            finish(start(*list_words(count, "local:1", folder / f"{file}.json")))
        cases = {kind: try_engine(kind, hosts, folder, n) for kind in kinds}
    text = dumps({"name": "fake_cluster", "hosts": HOSTS, "cases": cases}, indent=1)
    print(text)
    if json:
        json.write_text(text + "\n", "utf-8")
    if not all(case["same"] and case["same_with_kill"] for case in cases.values()):
        raise SystemExit("the figures of a cluster differ")


if __name__ == "__main__":
    tyro.cli(main)
