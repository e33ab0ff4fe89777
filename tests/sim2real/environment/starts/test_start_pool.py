"""Pools of initial states."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from robots import load_robot
from sim2real.environment.starts.start_pool import LEAST, StartPool
from sim2real.environment.starts.start_states import make_backward_pool


def test_what_fails_is_drawn_more_often():
    pool = StartPool.of(np.zeros((4, 1)))
    pool.success[2:] = 1.0
    drawn = pool.draw(20_000, np.random.default_rng(0))
    count = np.bincount(drawn, minlength=4)
    assert count[2:].sum() / count[:2].sum() == pytest.approx(LEAST, rel=0.1)
    assert count[0] == pytest.approx(count[1], rel=0.1)


def test_levels_that_are_open_are_drawn_alike_however_hard_they_are():
    pool = StartPool.of(np.zeros((44, 7)), np.repeat([0, 1, 2], [4, 36, 4]))
    pool.success[:22] = 1.0  # all of level 0, half of level 1
    drawn = pool.draw(4000, np.random.default_rng(0), 1)
    assert drawn.max() < 40, "level 2 is not open"
    assert np.mean(drawn < 4) == pytest.approx(0.5, abs=0.04)
    assert np.mean(drawn >= 22) == pytest.approx(0.5 / 1.15, abs=0.04)


def test_a_share_of_success_follows_how_episodes_end():
    pool = StartPool.of(np.zeros((3, 1)))
    for _ in range(50):
        pool.note(np.array([0, 1]), np.array([True, False]))
    assert pool.success == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    pool.note(np.array([0]), np.array([False]))
    assert 0.0 < pool.success[0] < 1.0


def test_a_pool_of_another_robot_or_of_another_width_is_refused(tmp_path: Path, op3, falls):
    file = tmp_path / "falls.npz"
    StartPool.of(falls).save(file, op3)
    tiny = load_robot("tests/robots/tiny")
    with pytest.raises(ValueError, match=f"it is of robot 'op3', expected '{tiny.name}'"):
        StartPool.load(file, tiny, 27)
    with pytest.raises(ValueError, match=r"qpos has shape \(16, 27\), expected \(any, 28\)"):
        StartPool.load(file, op3, 28)


def test_a_pool_along_rises_survives_its_file_and_knows_its_falls(tmp_path: Path, op3, world):
    pool = make_backward_pool(world, 2, np.random.default_rng(0))
    pool.save(tmp_path / "falls.npz", op3)
    again = StartPool.load(tmp_path / "falls.npz", op3, world.model.nq)
    assert [file.name for file in tmp_path.iterdir()] == ["falls.npz"]
    assert np.array_equal(again.qpos, pool.qpos)
    assert np.array_equal(again.level, pool.level)
    assert again.fallen.sum() == 4  # two, and their mirror images
    assert again.level[again.fallen].tolist() == [again.level.max()] * 4
    assert again.level[~again.fallen].max() == again.level.max() - 1
