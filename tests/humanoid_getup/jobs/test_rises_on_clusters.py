"""Ray and Dask give the rises that this process gives."""

from typing import Any

import pytest
from rise_figures_of import read_rises

from humanoid_getup.jobs.benchmark import benchmark
from humanoid_getup.jobs.requests.bench import BenchRise
from robots.storage.encoding import to_json

pytestmark = pytest.mark.scale
QUICK: dict[str, Any] = {"n": 1, "seed": 4, "planning": False, "filtering": False}


@pytest.mark.parametrize(("engine", "package"), [("ray:2", "ray"), ("dask:2", "distributed")])
def test_a_cluster_gives_what_one_process_gives(engine: str, package: str):
    pytest.importorskip(package)
    here = read_rises(to_json(benchmark(BenchRise(engine="local:1", **QUICK))))
    assert len(here) == 3
    assert read_rises(to_json(benchmark(BenchRise(engine=engine, **QUICK)))) == here
