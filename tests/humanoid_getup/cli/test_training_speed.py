"""The time to go is honest: it follows the present rate."""

import math

import pytest

from humanoid_getup.cli.train import REMEMBERED, TrainingSpeed, format_time


def test_nobody_knows_the_rate_after_one_report():
    speed = TrainingSpeed()
    speed.note(5.0, 10)
    assert math.isnan(speed.rate)
    assert math.isnan(speed.time_to_go(100))


def test_the_rate_is_that_of_the_last_reports_alone():
    speed = TrainingSpeed()
    for i in range(100):  # a start ten times as fast as what follows
        speed.note(0.1 * i, i)
    for i in range(REMEMBERED):
        speed.note(10.0 + i, 100 + i)
    assert speed.rate == pytest.approx(1.0)
    assert speed.time_to_go(200) == pytest.approx(200 - (100 + REMEMBERED - 1))


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(42.0, "42 s"), (420.0, "7 min"), (3900.0, "65 min"), (7500.0, "2 h 05 min"), (math.nan, "?")],
)
def test_a_duration_is_written_for_people(seconds: float, words: str):
    assert format_time(seconds) == words
