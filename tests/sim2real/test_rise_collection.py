"""Rises are planned once, from falls that their count and seed alone decide."""

import numpy as np
import pytest

from sim2real.prior_training.collect import collect_rises, load_policy


def test_rises_are_not_taken_from_an_unknown_or_styled_policy(op3):
    with pytest.raises(ValueError, match="unknown policy 'none'"):
        load_policy(op3, "none")
    with pytest.raises(ValueError, match="policy 'styled' follows style curves, expected one"):
        load_policy(op3, "styled")


@pytest.mark.slow
def test_what_is_planned_is_kept_and_not_planned_again(op3, tmp_path):
    reports: list[float] = []
    first = collect_rises(op3, 4, 3, tmp_path, {}, jobs=2, report=reports.append)
    assert sum(reports) == 4
    planned = [rise for rise in first if rise.source.startswith("planned")]
    assert len(planned) >= 2
    written = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/*.npz")}
    robust = {"robust": load_policy(op3, "robust")}
    again = collect_rises(op3, 4, 3, tmp_path, robust, jobs=1)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/*.npz")} == written
    assert all(
        np.array_equal(one.qpos, other.qpos) for one, other in zip(first, again, strict=False)
    )
    assert [rise.source for rise in again[len(first) :]] == ["policy: robust"] * (
        len(again) - len(first)
    )
    collect_rises(op3, 4, 4, tmp_path, {})  # other falls
    assert len(list(tmp_path.iterdir())) == 2
