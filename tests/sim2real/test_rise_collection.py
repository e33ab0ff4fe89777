"""Rises are planned once, from falls that their count and seed alone decide."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.commands.learn.make_prior import PriorRequest, make_prior
from sim2real.prior_training.collect import (
    EndPlan,
    PriorPiece,
    collect_rises,
    load_policy,
    plan_piece,
)


def plan_here(pieces: Mapping[str, PriorPiece], end: EndPlan) -> None:
    for name, piece in pieces.items():
        end(name, plan_piece("op3", 1, piece))


def test_rises_are_not_taken_from_an_unknown_or_styled_policy(op3):
    with pytest.raises(ValueError, match="unknown policy 'none'"):
        load_policy(op3, "none")
    with pytest.raises(ValueError, match="policy 'styled' follows style curves, expected one"):
        load_policy(op3, "styled")


@pytest.mark.slow
def test_what_is_planned_is_kept_and_not_planned_again(op3, tmp_path):
    reports: list[float] = []
    first = collect_rises(op3, 4, 3, tmp_path, {}, run=plan_here, report=reports.append)
    assert sum(reports) == 4
    planned = [rise for rise in first if rise.source.startswith("planned")]
    assert len(planned) >= 2
    written = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/*.npz")}
    robust = {"robust": load_policy(op3, "robust")}
    again = collect_rises(op3, 4, 3, tmp_path, robust, run=plan_here)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/*.npz")} == written
    for one, other in nonempty(zip(first, again, strict=False)):
        assert np.array_equal(one.qpos, other.qpos)
    assert {rise.source for rise in again[len(first) :]} <= {"policy: robust"}
    collect_rises(op3, 4, 4, tmp_path, {}, run=plan_here)  # other falls
    assert len(list(tmp_path.iterdir())) == 2


def read_all(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.npz")}


@pytest.mark.slow
def test_a_prior_does_not_depend_on_the_engine(tmp_path: Path):
    for name, engine in {"one": "local:1", "two": "local:2"}.items():
        make_prior(
            PriorRequest(out=tmp_path / name, rises=4, policies=(), seed=3, epochs=1, engine=engine)
        )
    found = read_all(tmp_path / "one")
    assert len(found) >= 2 + 2
    assert read_all(tmp_path / "two") == found
