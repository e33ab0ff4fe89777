"""An engine is named by its kind and its workers."""

import os

import pytest

from humanoid_getup.engines.engine import Engine


@pytest.mark.parametrize(
    ("name", "kind", "workers"),
    [
        ("local", "local", None),
        ("local:3", "local", 3),
        ("ray:2", "ray", 2),
        ("dask", "dask", None),
    ],
)
def test_a_name_says_the_kind_and_the_workers(name: str, kind: str, workers: int | None):
    engine = Engine.parse(name)
    assert (engine.kind, engine.workers) == (kind, workers)


@pytest.mark.parametrize(
    ("name", "address", "message"),
    [
        ("cloud", "", "engine is 'cloud', expected local, ray, dask or slurm"),
        ("dask:tls://a:1", "", "engine is 'dask:tls://a:1', expected local, ray, dask or slurm"),
        ("local:" + 5000 * "9", "", "engine is 'local:9.*', expected local, ray, dask or slurm"),
        ("local:0", "", "expected 1 to 256 workers"),
        ("local:", "", "engine is 'local:', expected local"),
        ("local:-1", "", "engine is 'local:-1'"),
        ("local", "10.0.0.1:6379", "expected none with engine local"),
        ("ray:4", "10.0.0.1:6379", "expected ray alone"),
    ],
)
def test_a_name_of_no_engine_is_refused(name: str, address: str, message: str):
    with pytest.raises(ValueError, match=message):
        Engine.parse(name, address)


def test_a_few_pieces_need_no_process_more():
    assert Engine.parse("local").choose_workers(3) == 1
    assert Engine.parse("local").choose_workers(10_000) == len(os.sched_getaffinity(0))
    assert Engine.parse("local:4").choose_workers(10_000) == 4
    assert Engine.parse("local:4").choose_workers(3) == 3
