"""What is done of long work is kept as it is, and never taken for that of another recipe."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.progress.ledger import Ledger

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(allow_nan=False, width=32),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)
RECIPE: dict[str, Any] = {"seed": 0, "world": "a" * 32}


@given(parts=st.dictionaries(st.text(max_size=9), JSON, min_size=1, max_size=4))
def test_what_is_loaded_is_what_was_kept(tmp_path_factory, parts):
    path = tmp_path_factory.mktemp("work") / "new" / "ledger.jsonl"
    ledger = Ledger.resume(path, RECIPE)
    assert ledger.done == {}
    kept = {name: ledger.add(name, result) for name, result in parts.items()}
    again = Ledger.resume(path, RECIPE)
    assert again.done == kept
    assert list(again.done) == list(parts)


def test_a_new_ledger_replaces_the_one_that_is_there_with_its_first_part(tmp_path: Path):
    path = tmp_path / "ledger.jsonl"
    Ledger(path, RECIPE).add("one", 1)
    ledger = Ledger(path, {"seed": 7})
    assert Ledger.resume(path, RECIPE).done == {"one": 1}
    ledger.add("two", 2)
    assert Ledger.resume(path, {"seed": 7}).done == {"two": 2}


@pytest.mark.parametrize(("begin", "content"), [(Ledger, None), (Ledger.resume, "my notes")])
def test_a_link_is_refused_and_what_it_leads_to_stays(tmp_path: Path, begin, content):
    target, path = tmp_path / "elsewhere", tmp_path / "ledger.jsonl"
    if content is not None:
        target.write_text(content)
    path.symlink_to(target)
    with pytest.raises(ValueError, match=r"ledger\.jsonl: is a symbolic link, expected a file"):
        begin(path, RECIPE).add("one", 1)
    assert (target.read_text() if target.exists() else None) == content


@pytest.mark.parametrize(
    ("recipe", "message"),
    [
        (RECIPE | {"seed": 1}, r"made with another seed \(0, now 1\), expected the same"),
        (RECIPE | {"world": "b" * 32}, "made with another world, expected the same"),
        ({"seed": 0}, "made with another world, expected the same"),
    ],
)
def test_the_work_of_another_recipe_is_refused_by_what_differs(tmp_path: Path, recipe, message):
    Ledger(tmp_path / "ledger.jsonl", RECIPE).add("one", 1)
    with pytest.raises(ValueError, match=message):
        Ledger.resume(tmp_path / "ledger.jsonl", recipe)


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"recipe": {}}'])
def test_a_damaged_ledger_is_refused_in_one_line(tmp_path: Path, damage: str):
    path = tmp_path / "ledger.jsonl"
    path.write_text(damage)
    with pytest.raises(ValueError, match=r"it starts over|is no ledger") as message:
        Ledger.resume(path, RECIPE)
    assert str(message.value).isprintable()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"rises":3', '"rises":4'),
        ("\n", "\r\n"),
        ('{"part":"two",', '{"part": "two",'),
        ('{"part":"one"', '{"part":"one"}\n{"part":"one"'),
    ],
)
def test_a_line_that_was_changed_is_refused(tmp_path: Path, old: str, new: str):
    path = keep_two(tmp_path)
    path.write_bytes(path.read_bytes().replace(old.encode(), new.encode()))
    with pytest.raises(ValueError, match="it is damaged"):
        Ledger.resume(path, RECIPE)


def test_a_line_that_was_removed_is_missed(tmp_path: Path):
    path = keep_two(tmp_path)
    head, _first, second = path.read_text().splitlines(keepends=True)
    path.write_text(head + second)
    with pytest.raises(ValueError, match="it is damaged"):
        Ledger.resume(path, RECIPE)


@given(cut=st.integers(1, 50))
def test_a_last_line_that_is_cut_off_is_done_again(tmp_path_factory, cut: int):
    path = keep_two(tmp_path_factory.mktemp("work"))
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    ledger = Ledger.resume(path, RECIPE)
    assert ledger.done == {"one": {"rises": 3}}
    ledger.add("two", [0.5])
    assert path.read_bytes() == whole


def test_two_programs_with_one_ledger_are_refused(tmp_path: Path):
    path = keep_two(tmp_path)
    first, second = (Ledger.resume(path, RECIPE) for _ in range(2))
    first.add("three", 3)
    with pytest.raises(ValueError, match="another program adds parts as well"):
        second.add("four", 4)
    assert "three" in Ledger.resume(path, RECIPE).done
    third, fourth = Ledger(path, RECIPE), Ledger(path, RECIPE)
    third.add("five", 5)
    fourth.add("six", 6)
    with pytest.raises(ValueError, match="another program adds parts as well"):
        third.add("seven", 7)


def keep_two(folder: Path) -> Path:
    ledger = Ledger(folder / "ledger.jsonl", RECIPE)
    ledger.add("one", {"rises": 3})
    ledger.add("two", [0.5])
    return ledger.path
