"""Levels of initial states open one by one."""

import numpy as np

from sim2real.environment.starts.level_curriculum import TO_OPEN, LevelCurriculum


def test_levels_open_one_by_one_after_enough_successes():
    levels = np.array([0, 1, 2, 3])
    curriculum = LevelCurriculum(levels)
    curriculum.note(np.array([1, 2]), np.array([True, True]))
    assert (curriculum.open, curriculum.successes) == (0, 0)  # only those of level 0 count
    for _ in range(TO_OPEN):
        curriculum.note(np.array([0, 0]), np.array([True, False]))
    assert curriculum.open == 1
    for level in (1, 2, 3):
        curriculum.note(np.full(3 * TO_OPEN, level), np.ones(3 * TO_OPEN, dtype=bool))
    assert curriculum.open == 3
    again = LevelCurriculum(levels)
    again.restore_state(curriculum.save_state())
    assert (again.open, again.successes) == (curriculum.open, curriculum.successes)
