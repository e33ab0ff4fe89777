"""Hosts on one machine: network namespaces of Linux, each with its address, name and /tmp."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
HOSTS = 3
NETWORK = "10.77.0"
BRIDGE = "getup-bridge"
POLL = 0.2  # s
ENTER = 'hostname "$1" && mount --bind "$2" /tmp && shift 2 && exec "$@"'


@dataclass(frozen=True, kw_only=True)
class FakeHost:
    """A network namespace that stands for a host."""

    name: str
    address: str
    folder: Path
    """Its /tmp."""

    def start(
        self, *words: str | Path, path: str = str(REPOSITORY), log: Path | None = None
    ) -> subprocess.Popen[str]:
        """Start a program on the host, with folders on which Python finds modules.

        Args:
            words: The program and its arguments.
            path: The folders.
            log: File for what it prints; by default, pipes.
        """
        enter = ("ip", "netns", "exec", self.name, "unshare", "--uts", "sh", "-c", ENTER, "sh")
        return start(*enter, self.name, self.folder, *words, path=path, log=log)

    def serve(self, *words: str | Path, path: str = str(REPOSITORY)) -> None:
        """Start a program that runs until the host is killed; its log lies in the host's /tmp."""
        self.start(*words, path=path, log=self.folder / f"{Path(words[0]).name}.log")

    def kill(self) -> int:
        """Kill all its processes; return their number."""
        listed = run_ip("netns", "pids", self.name).split()
        for number in map(int, listed):
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        return len(listed)


def start(
    *words: str | Path, path: str = str(REPOSITORY), log: Path | None = None
) -> subprocess.Popen[str]:
    """Start a program, with folders on which Python finds modules, and a file for its output."""
    with log.open("a") if log else contextlib.nullcontext(subprocess.PIPE) as output:
        return subprocess.Popen(
            [*map(str, words)],
            env=os.environ | {"PYTHONPATH": path},
            cwd="/",
            stdout=output,
            stderr=output,
            text=True,
        )


def run_ip(*words: str) -> str:
    """Run `ip`; return what it prints."""
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True).stdout


@contextmanager
def fake_hosts(folder: Path, count: int = HOSTS) -> Iterator[list[FakeHost]]:
    """Make hosts and the network between them; remove both and end all processes at the end."""
    with ExitStack() as stack:
        run_ip("link", "add", BRIDGE, "type", "bridge")
        stack.callback(run_ip, "link", "del", BRIDGE)
        run_ip("link", "set", BRIDGE, "up")
        yield [stack.enter_context(_fake_host(folder, number + 1)) for number in range(count)]


@contextmanager
def _fake_host(folder: Path, number: int) -> Iterator[FakeHost]:
    """Make a host and its link to the bridge."""
    name, link = f"getup-{number}", f"getup-link-{number}"
    host = FakeHost(name=name, address=f"{NETWORK}.{number}", folder=folder / name)
    host.folder.mkdir()
    run_ip("netns", "add", name)
    try:
        run_ip("link", "add", link, "type", "veth", "peer", "name", "eth0", "netns", name)
        run_ip("link", "set", link, "master", BRIDGE, "up")
        run_ip("-n", name, "address", "add", f"{host.address}/24", "dev", "eth0")
        for device in ("eth0", "lo"):
            run_ip("-n", name, "link", "set", device, "up")
        yield host
    finally:
        while host.kill():
            time.sleep(POLL)
        run_ip("netns", "del", name)
