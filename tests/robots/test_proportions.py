"""A body as text: there and back again, and all that is wrong with it in one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.proportions import MAX_FACTOR, MIN_FACTOR, ORIGINAL, PARTS, Body, BodyError

factors = st.floats(MIN_FACTOR, MAX_FACTOR)


@given(st.fixed_dictionaries({}, optional=dict.fromkeys(PARTS, factors)))
def test_a_body_survives_the_trip_through_text(chosen: dict[str, float]):
    body = Body(**chosen)
    assert Body.parse(str(body)) == body


def test_a_body_without_other_factors_is_the_original():
    for text in ("", " ", "arms=1", "arms=1,legs=1.0"):
        assert Body.parse(text) == ORIGINAL
        assert Body.parse(text).is_original
        assert str(Body.parse(text)) == ""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tail=2", "body 'tail=2': unknown part 'tail', expected shoulders, arms, torso, legs"),
        ("arms", "arms is '', expected a factor from 0.25 to 4"),
        ("arms=nan", "arms is 'nan'"),
        ("arms=4.1", "arms is '4.1'"),
        ("arms=1.6,arms=1.7", "arms is given twice, expected once"),
        ("arms=0,tail=1", "arms is '0', expected a factor from 0.25 to 4; unknown part 'tail'"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line(text: str, message: str):
    with pytest.raises(BodyError) as error:
        Body.parse(text)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
