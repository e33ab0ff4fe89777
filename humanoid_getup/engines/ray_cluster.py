"""Ray as an engine: a cluster that is running, or one of this machine that ends with the work."""

from __future__ import annotations

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


@contextmanager
def start_ray(engine: Engine, _pieces: int) -> Iterator[Workers]:
    """Start Ray on this machine, or connect to a cluster.

    Raises:
        EngineError: if it does not answer, or has no processors.
    """
    import ray

    try:
        if engine.address:
            ray.init(address=engine.address, log_to_driver=False, logging_level="ERROR")
        else:
            ray.init(
                address="local",
                num_cpus=engine.workers,
                include_dashboard=False,
                log_to_driver=False,
                logging_level="ERROR",
            )
    except Exception as error:
        where = f" at {engine.address}" if engine.address else ""
        raise EngineError(
            f"no Ray cluster answers{where} ({' '.join(str(error).split())[:200]}), expected one "
            "that `ray start` runs, or no --address"
        ) from error
    try:
        count = int(ray.cluster_resources().get("CPU", 0))
        if not count:
            raise EngineError(f"the Ray cluster at {engine.address} has no processors")
        yield Workers(executor=RayExecutor(ray), count=count)
    finally:
        ray.shutdown()


class RayExecutor(Executor):
    """Submits each piece as a task of Ray, which tries it again if its worker is lost."""

    def __init__(self, ray: Any) -> None:
        """Submit to a cluster to which ``ray`` is connected."""
        self._lost = (
            ray.exceptions.WorkerCrashedError,
            ray.exceptions.NodeDiedError,
            ray.exceptions.OutOfMemoryError,
        )
        self._run = ray.remote(num_cpus=1, max_retries=TRIES - 1)(_call)

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Submit a piece."""
        return forward(self._run.remote(work, arguments, options).future(), self._translate)

    def _translate(self, error: BaseException) -> BaseException:
        if isinstance(error, self._lost):
            return WorkerLostError(TRIES, type(error).__name__)
        return getattr(error, "cause", error)  # of the error of a task


def _call(work: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any]) -> Any:
    return work(*arguments, **options)
