"""Dask as an engine: a cluster that is running, one of this machine, or jobs of Slurm."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from shutil import which
from typing import Any

from humanoid_getup.engines.engine import LOST, TRIES, Engine

CONNECT_TIME = 10.0  # s
MOST_SHOWN = 200  # characters of a reason
SLURM_WORKERS = 8
MEMORY = "4GB"  # of a worker; one takes 0.6 GB


@contextmanager
def start_dask(engine: Engine) -> Iterator[Executor]:
    """Start Dask on this machine or in jobs of Slurm, or connect to a cluster.

    Raises:
        ValueError: if the cluster does not answer or has no workers, or if a piece ended its
            worker repeatedly.
        ModuleNotFoundError: if a package is missing.
    """
    from dask import config
    from dask.distributed import Client, KilledWorker

    config.set({"distributed.scheduler.allowed-failures": TRIES - 1})
    with ExitStack() as stack:
        cluster = engine.address or stack.enter_context(_start_cluster(engine))
        try:
            client: Any = stack.enter_context(Client(cluster, timeout=CONNECT_TIME))
        except Exception as error:  # of whatever carries tls://, ucx:// and others
            reason = " ".join(str(error).split())[:MOST_SHOWN]
            raise ValueError(
                f"no Dask scheduler answers at {cluster} ({reason}), expected one that "
                "`dask scheduler` runs, such as tcp://127.0.0.1:8786"
            ) from error
        if engine.address and not client.nthreads():
            raise ValueError(
                f"the Dask scheduler at {cluster} has no workers, expected some that "
                "`dask worker` runs"
            )
        try:
            yield client.get_executor(pure=False)
        except KilledWorker as error:
            raise ValueError(LOST) from error


def _start_cluster(engine: Engine) -> Any:
    """Start workers on this machine, or as jobs of Slurm.

    Raises:
        ValueError: if there is no Slurm.
    """
    if engine.kind == "dask":
        from dask.distributed import LocalCluster

        options: dict[str, Any] = {"threads_per_worker": 1, "dashboard_address": None}
        return LocalCluster(n_workers=engine.workers, **options)
    from dask_jobqueue.slurm import SLURMCluster

    if which("sbatch") is None:
        raise ValueError("there is no `sbatch`, expected a machine that submits jobs to Slurm")
    count = engine.workers or SLURM_WORKERS
    cluster: Any = SLURMCluster(cores=1, processes=1, memory=MEMORY)
    cluster.adapt(minimum=count, maximum=count)  # jobs that end at their time limit are replaced
    return cluster
