"""Dask as an engine: a cluster that is running, one of this machine, or jobs of Slurm."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from functools import partial
from multiprocessing import current_process
from shutil import which
from typing import Any, TypeVar

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.errors import EngineError, WorkerLostError
from humanoid_getup.engines.forwarded import forward
from humanoid_getup.engines.local_processes import TRIES
from humanoid_getup.engines.workers import Workers

CONNECT_TIME = 10.0  # s
MOST_SHOWN = 200  # characters of a reason
SLURM_WORKERS = 8
MEMORY = "4GB"  # of a worker; one takes 0.6 GB

Result = TypeVar("Result")


@contextmanager
def start_dask(engine: Engine, _pieces: int) -> Iterator[Workers]:
    """Start Dask on this machine, or connect to a cluster.

    Raises:
        EngineError: if it does not answer, or has no workers.
    """
    from dask.distributed import Client, LocalCluster

    with ExitStack() as stack:
        if not engine.address:
            local: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None}
            cluster = LocalCluster(n_workers=engine.workers, **local)
            client = stack.enter_context(Client(stack.enter_context(cluster)))
            yield _count_workers(client)
            return
        try:
            client = stack.enter_context(Client(engine.address, timeout=CONNECT_TIME))
        except Exception as error:  # of whatever carries tls://, ucx:// and others
            reason = " ".join(str(error).split())[:MOST_SHOWN]
            raise EngineError(
                f"no Dask scheduler answers at {engine.address} ({reason}), expected one that "
                "`dask scheduler` runs, such as tcp://127.0.0.1:8786"
            ) from error
        workers = _count_workers(client)
        if not workers.count:
            raise EngineError(
                f"the Dask scheduler at {engine.address} has no workers, expected some that "
                "`dask worker` runs"
            )
        yield workers


@contextmanager
def start_slurm(engine: Engine, _pieces: int) -> Iterator[Workers]:
    """Start workers as jobs of Slurm; each does pieces when its job runs.

    Raises:
        EngineError: if there is no Slurm.
    """
    from dask.distributed import Client
    from dask_jobqueue.slurm import SLURMCluster

    if which("sbatch") is None:
        raise EngineError("there is no `sbatch`, expected a machine that submits jobs to Slurm")
    count = engine.workers or SLURM_WORKERS
    with ExitStack() as stack:
        cluster: Any = SLURMCluster(cores=1, processes=1, memory=MEMORY)
        # Jobs end at their time limit: others take their place.
        stack.enter_context(cluster).adapt(minimum=count, maximum=count)
        client = stack.enter_context(Client(cluster))
        yield Workers(executor=DaskExecutor(client), count=count)


def _count_workers(client: Any) -> Workers:
    """Count the workers of a cluster, each of which does one piece at a time."""
    return Workers(executor=DaskExecutor(client), count=len(client.nthreads()))


def _work_as_parent(work: Callable[..., Result], *arguments: Any, **options: Any) -> Result:
    """Do a piece in a worker, which Dask starts as a daemon: those may start no processes."""
    current_process().daemon = False
    return work(*arguments, **options)


class DaskExecutor(Executor):
    """Submits each piece as a task of Dask, which tries it again if its worker is lost."""

    def __init__(self, client: Any) -> None:
        """Submit to the cluster of a client."""
        from dask import config
        from dask.distributed import KilledWorker

        config.set({"distributed.scheduler.allowed-failures": TRIES - 1})
        self._lost = KilledWorker
        self._inner = client.get_executor(pure=False)

    def submit(
        self, work: Callable[..., Result], /, *arguments: Any, **options: Any
    ) -> Future[Result]:
        """Submit a piece."""
        piece = partial(_work_as_parent, work)
        return forward(self._inner.submit(piece, *arguments, **options), self._translate)

    def _translate(self, error: BaseException) -> BaseException:
        if isinstance(error, self._lost):
            return WorkerLostError(TRIES, "Dask gave it up")
        return error
