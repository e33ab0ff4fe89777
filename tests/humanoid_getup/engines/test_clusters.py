"""Ray and Dask give what processes of this machine give; a lost worker costs one piece."""

from pathlib import Path

import pytest
from counted_work import TRACE, die_once, refuse, square_in_a_child, square_slowly
from engine_runs import run

from humanoid_getup.engines.engine import Engine
from humanoid_getup.engines.errors import EngineError
from humanoid_getup.engines.run_pieces import start_workers

pytestmark = pytest.mark.scale
CLUSTERS = ["ray:2", "dask:2"]


@pytest.fixture(autouse=True)
def installed(request: pytest.FixtureRequest) -> None:
    """Skip without the package of an engine."""
    name = str(request.node.callspec.params["engine"]).partition(":")[0]
    pytest.importorskip("ray" if name == "ray" else "distributed")


@pytest.mark.parametrize("engine", CLUSTERS)
def test_results_do_not_depend_on_the_engine(engine: str):
    assert run(engine, square_slowly, [*range(11)]) == [n * n for n in range(11)]


@pytest.mark.parametrize("engine", CLUSTERS)
def test_an_error_of_a_piece_is_raised_as_it_is(engine: str):
    with pytest.raises(ValueError, match=r"^number is 7, expected another$"):
        run(engine, refuse, [7])


@pytest.mark.parametrize("engine", CLUSTERS)
def test_a_killed_worker_costs_one_piece(engine: str, tmp_path: Path):
    pieces = [(tmp_path, number) for number in range(9)]
    assert run(engine, die_once, pieces) == [n * n for n in range(9)]
    assert len((tmp_path / f"{TRACE}_3").read_text()) == 2


@pytest.mark.parametrize("engine", CLUSTERS)
def test_a_piece_may_start_processes(engine: str):
    assert run(engine, square_in_a_child, [2, 3]) == [4, 9]


@pytest.mark.parametrize(
    ("engine", "address"),
    [
        ("ray", "127.0.0.1:1"),
        *(("dask", f"{kind}://127.0.0.1:1") for kind in ("tcp", "tls", "ucx", "bar")),
    ],
)
def test_a_cluster_that_does_not_answer_is_refused_in_one_line(engine: str, address: str):
    """Also by what is not set up for it here: certificates, or a network card."""
    with (
        pytest.raises(EngineError, match="answers at") as problem,
        start_workers(Engine.parse(engine, address), 1),
    ):
        pass
    assert str(problem.value).isprintable()
