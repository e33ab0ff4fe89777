"""Finished parts of a benchmark: kept as they are, and never those of another one."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from nonempty import nonempty

from humanoid_getup.benchmarks.part import Part
from humanoid_getup.cli.part_store import PartStore

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(allow_nan=False, width=32),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


def make_part(result=None, name: str = "plan, 61%", **depends) -> Part:
    return Part(
        name=name,
        count=1,
        depends={"seed": 0, "world": "a" * 64, **depends},
        run=lambda report: report({}) or {"rises": result},
    )


@given(result=JSON)
def test_what_is_loaded_is_what_was_run(tmp_path_factory, result):
    store, part = PartStore(tmp_path_factory.mktemp("parts")), make_part(result)
    assert store.load(part) is None
    ran = store.run(part, lambda _: None)
    assert store.load(part) == ran


@given(names=st.sets(st.text(max_size=80), min_size=2, max_size=5))
@example(names={"slope +5 deg", "slope -5 deg", "Slope 5 deg"})
def test_each_part_has_a_file_of_its_own(tmp_path_factory, names):
    folder = tmp_path_factory.mktemp("parts")
    for name in names:
        PartStore(folder).run(make_part(name, name), lambda _: None)
    for name in nonempty(names):
        kept = PartStore(folder).load(make_part(name=name))
        assert kept == json.loads(json.dumps({"rises": name}))


def test_a_part_of_another_benchmark_is_refused_by_what_differs(tmp_path: Path):
    store = PartStore(tmp_path)
    store.run(make_part(), lambda _: None)
    with pytest.raises(ValueError, match=r"made with another seed [(]0, now 1[)], expected the"):
        store.load(make_part(seed=1))
    with pytest.raises(ValueError, match="made with another world, expected the same"):
        store.load(make_part(world="b" * 64))


@pytest.mark.parametrize("damage", ["{", "[]", '{"depends": 3}'])
def test_a_damaged_part_is_refused_in_one_line(tmp_path: Path, damage: str):
    store, part = PartStore(tmp_path), make_part()
    store.run(part, lambda _: None)
    (file,) = tmp_path.iterdir()
    file.write_text(damage)
    with pytest.raises(ValueError, match="a run without --resume starts over") as told:
        store.load(part)
    assert str(told.value).isprintable()


def test_a_result_that_was_changed_is_refused(tmp_path: Path):
    store, part = PartStore(tmp_path), make_part(3)
    store.run(part, lambda _: None)
    (file,) = tmp_path.iterdir()
    file.write_text(json.dumps(json.loads(file.read_text()) | {"result": {"rises": 4}}))
    with pytest.raises(ValueError, match="its checksum differs"):
        store.load(part)


def test_a_run_anew_removes_the_parts_of_the_one_before_and_nothing_else(tmp_path: Path):
    store, part = PartStore(tmp_path), make_part()
    store.run(part, lambda _: None)
    (tmp_path / "notes.txt").write_text("mine")
    store.clear()
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert store.load(replace(part, depends={})) is None
