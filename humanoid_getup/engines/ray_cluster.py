"""Ray as an engine: a cluster that is running, or one of this machine that ends with the work."""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any, TypeVar

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.errors import EngineError, WorkerLostError
from humanoid_getup.engines.forwarded import forward
from humanoid_getup.engines.local_processes import TRIES
from humanoid_getup.engines.workers import Workers

Result = TypeVar("Result")
MOST_SHOWN = 200  # characters of a reason
CONNECT_TIME = 5.0  # s
FOUND = "auto"
"""Address that lets Ray find a cluster of this machine."""
REFUSED = "InvalidAuthToken"
"""What Ray reports where a cluster requires a token."""
EXPECTED = "expected one that `ray start` runs, such as 127.0.0.1:6379"


@contextmanager
def start_ray(engine: Engine, _pieces: int) -> Iterator[Workers]:
    """Start Ray on this machine, or connect to a cluster.

    Raises:
        EngineError: if it does not answer, or has no processors.
    """
    import ray

    where: dict[str, Any] = {"address": engine.address}
    if not engine.address:
        # Its workers are no children of this process: they find modules by this path.
        path = {"env_vars": {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}}
        where = {
            "address": "local",
            "num_cpus": engine.workers,
            "include_dashboard": False,
            "runtime_env": path,
        }
    if engine.address not in ("", FOUND):
        _check_answer(engine.address)
    try:
        ray.init(**where, log_to_driver=False, logging_level=logging.ERROR)
    except Exception as error:
        if REFUSED in str(error.__cause__):
            raise EngineError(
                f"the Ray cluster at {where['address']} refuses a missing or wrong token, expected "
                "RAY_AUTH_MODE=token and the file ~/.ray/auth_token of its head"
            ) from error
        reason = " ".join(str(error).split())[:MOST_SHOWN]
        raise EngineError(f"no Ray cluster at {where['address']} ({reason}), {EXPECTED}") from error
    try:
        count = int(ray.cluster_resources().get("CPU", 0))
        if not count:
            raise EngineError(f"the Ray cluster at {engine.address} has no processors")
        yield Workers(executor=RayExecutor(ray), count=count)
    finally:
        ray.shutdown()


def _check_answer(address: str) -> None:
    """Check that something answers at an address: Ray itself waits for minutes.

    Raises:
        EngineError: if nothing does.
    """
    host, _, port = address.rpartition("//")[2].rpartition(":")
    try:
        socket.create_connection((host, int(port)), CONNECT_TIME).close()
    except (OSError, ValueError, OverflowError) as error:
        raise EngineError(f"no Ray cluster answers at {address} ({error}), {EXPECTED}") from error


class RayExecutor(Executor):
    """Submits each piece as a task of Ray, which tries it again if its worker is lost."""

    def __init__(self, ray: Any) -> None:
        """Submit to a cluster to which ``ray`` is connected."""
        self._lost = (
            ray.exceptions.WorkerCrashedError,
            ray.exceptions.NodeDiedError,
            ray.exceptions.OutOfMemoryError,
        )
        self._system_error = ray.exceptions.RaySystemError
        self._run = ray.remote(num_cpus=1, max_retries=TRIES - 1)(_call)

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Submit a piece."""
        return forward(self._run.remote(work, arguments, options).future(), self._translate)

    def _translate(self, error: BaseException) -> BaseException:
        if isinstance(error, self._lost):
            return WorkerLostError(TRIES, type(error).__name__)
        if isinstance(error, self._system_error):
            reason = str(error).splitlines()[0].removeprefix("System error: ")
            return EngineError(
                f"a worker of Ray cannot read a piece ({reason}), expected the same release of "
                "humanoid-getup on each machine"
            )
        return getattr(error, "cause", error)  # of the error of a task


def _call(work: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any]) -> Any:
    return work(*arguments, **options)
