"""Keyframes that are written read back as they were, and nothing else in a file changes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from authored import load_robot_keyframes
from hypothesis import given, settings
from hypothesis import strategies as st

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.keyframes_writer import (
    append_keyframes,
    format_keyframes,
    replace_keyframes,
    save_keyframes,
)
from robots import Robot, load_robot

AUTHORED = load_robot_keyframes(load_robot("op3"))


def assert_same(read: Keyframes, written: Keyframes, *, degrees: float = 0.0051) -> None:
    assert read.free.tolist() == written.free.tolist()
    assert read.mirrored.tolist() == written.mirrored.tolist()
    assert np.degrees(np.abs(read.keys - written.keys)).max() <= degrees
    np.testing.assert_allclose(read.duration, written.duration, atol=0.00051)
    for field in ("name", "start_class", "end_class", "strategy"):
        assert getattr(read, field) == getattr(written, field)
    for field in ("torque_limit", "time_cost", "torque_cost"):
        assert getattr(read, field) == pytest.approx(getattr(written, field))


def test_what_people_wrote_is_read_back_as_it_was(tmp_path: Path, op3: Robot):
    save_keyframes(tmp_path / "keys.toml", AUTHORED, op3)
    for read, authored in zip(load_keyframes(tmp_path / "keys.toml", op3), AUTHORED, strict=True):
        # The stance has more decimals than a file: all other angles are whole degrees.
        standing = authored.start_class == "standing"
        assert_same(read, authored, degrees=0.0051 if standing else 1e-9)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), number=st.integers(0, len(AUTHORED) - 1))
def test_what_a_search_changed_is_read_back_within_the_rounding(
    seed: int, number: int, tmp_path_factory: pytest.TempPathFactory, op3: Robot
):
    authored, rng = AUTHORED[number], np.random.default_rng(seed)
    noise = rng.normal(scale=0.3, size=len(authored.genes))
    changed = authored.with_genes(authored.genes + noise, op3)
    path = tmp_path_factory.mktemp("keys") / "keys.toml"
    save_keyframes(path, [changed], op3)
    (read,) = load_keyframes(path, op3)
    # Left and right that differ by up to 0.05° are written as one, their mean.
    assert_same(read, changed, degrees=0.0051 + 0.025)


def test_a_posture_that_is_nearly_symmetric_is_written_for_both_sides(op3: Robot):
    authored = next(each for each in AUTHORED if each.name == "prone_push_up_fast")
    left = op3.joint_names.index("l_knee")
    for degrees, tables in ((0.04, ("both",)), (0.06, ("both", "left", "right"))):
        keys = authored.keys.copy()
        keys[2, left] += np.radians(degrees)
        line = format_keyframes([replace(authored, keys=keys)], op3).splitlines()[11]
        assert [table for table in ("both", "left", "right") if f"{table} =" in line] == [*tables]


@pytest.fixture
def file(tmp_path: Path, op3: Robot) -> Path:
    """A copy of OP3's keyframes."""
    path = tmp_path / "keyframes.toml"
    path.write_text((op3.folder / "keyframes.toml").read_text("utf-8"), "utf-8")
    return path


def test_what_is_appended_leaves_the_text_before_it_alone(file: Path, op3: Robot):
    before = file.read_text("utf-8")
    append_keyframes(file, [replace(AUTHORED[0], name="another")], op3)
    assert file.read_text("utf-8").startswith(before.rstrip())
    assert [each.name for each in load_keyframes(file, op3)] == [
        *(each.name for each in AUTHORED),
        "another",
    ]


@pytest.mark.parametrize("number", [0, len(AUTHORED) - 1])
def test_only_the_tables_that_are_replaced_change(number: int, file: Path, op3: Robot):
    before = file.read_text("utf-8")
    replace_keyframes(file, [replace(AUTHORED[number], torque_limit=3.3)], op3)
    read = load_keyframes(file, op3)
    for k, (each, authored) in enumerate(zip(read, AUTHORED, strict=True)):
        assert_same(each, replace(authored, torque_limit=3.3) if k == number else authored)
    comments = [line for line in before.splitlines() if line.startswith("#")]
    after = file.read_text("utf-8")
    assert [line for line in after.splitlines() if line.startswith("#")] == comments
    replace_keyframes(file, [AUTHORED[number]], op3)
    again = file.read_text("utf-8")
    blocks = [text.split("[[motions]]") for text in (before, again)]
    same = [a == b for a, b in zip(*blocks, strict=True)]
    assert same == [k != number + 1 for k in range(len(same))]
