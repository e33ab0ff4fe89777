"""When episodes are over, and which of them count as a success."""

import numpy as np

from sim2real.environment.episodes import TO_OPEN, Episodes, LevelCurriculum

LONGEST, HELD = 120, 30  # policy steps
NONE, ALL = np.zeros(3, dtype=bool), np.ones(3, dtype=bool)


def begin(*, ends_early: bool) -> Episodes:
    """Begin three episodes: from falls 7 and 8, this one with help, and one from elsewhere."""
    episodes = Episodes.of(3, LONGEST)
    force = np.array([0.02, 0.3, 0.0])
    episodes.begin(np.arange(3), np.array([7, 8, -1]), np.full(3, ends_early), force)
    return episodes


def test_a_fall_with_help_does_not_count_as_stood_alone():
    episodes = begin(ends_early=True)
    for _ in range(HELD):
        outcome = episodes.advance(ALL, NONE, NONE, HELD)
    assert outcome.from_pool.tolist() == [0, 1]
    assert outcome.stood.tolist() == [True, True]
    assert outcome.alone.tolist() == [True, False]


def test_a_stand_that_is_held_without_interruption_ends_an_episode_as_a_success():
    episodes = begin(ends_early=True)
    for stands in (
        NONE,
        np.array([True, False, True]),
    ):  # in the step that could have been its last
        for _ in range(HELD - 1):
            assert not len(episodes.advance(ALL, NONE, NONE, HELD).ended)
        outcome = episodes.advance(stands, NONE, NONE, HELD)
    assert outcome.ended.tolist() == [0, 2]
    assert outcome.starts.tolist() == [7]
    assert outcome.stood.tolist() == [True]


def test_an_episode_ends_with_its_time_and_what_diverged_never_stood():
    episodes = begin(ends_early=False)
    outcomes = [episodes.advance(ALL, NONE, NONE, HELD) for _ in range(LONGEST - 1)]
    assert not any(len(outcome.ended) for outcome in outcomes)
    outcome = episodes.advance(ALL, NONE, np.array([False, True, False]), HELD)
    assert outcome.ended.tolist() == [0, 1, 2]
    assert outcome.stood.tolist() == [True, False]


def test_deviating_ends_an_episode_and_it_may_go_on_as_another_of_its_own_length():
    episodes = begin(ends_early=False)
    outcome = episodes.advance(NONE, np.array([False, True, False]), NONE, HELD)
    assert outcome.ended.tolist() == [1]
    assert outcome.stood.tolist() == [False]
    episodes.restart(outcome.ended)
    episodes.limit(outcome.ended, np.array([3.5]))
    ends = [episodes.advance(NONE, NONE, NONE, HELD).ended.tolist() for _ in range(4)]
    assert ends == [[], [], [], [1]]


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
