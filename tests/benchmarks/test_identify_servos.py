"""Virtual servos are identified, and the intervals that hold the truth are counted."""

import identify_servos
import pytest
from identify_servos import Found, IdentifyOptions, summarize

from sim2real.identification.servo_fit import Estimate


def test_intervals_that_hold_the_truth_are_counted():
    """Friction 0.1 is in 0.08 to 0.12, not in 0.11 to 0.13; 0.5 is in 0 to 2, but open."""
    estimates = [(0.1, 0.08, 0.12), (0.12, 0.11, 0.13), (1.0, 0.0, 2.0)]
    truths = (0.1, 0.1, 0.5)
    found = [
        Found(
            servo="",
            form="",
            model="",
            truth={"friction": truth, "stiction": 0.1},
            parameters={"friction": Estimate(value=value, lower=lower, upper=upper)},
        )
        for truth, (value, lower, upper) in zip(truths, estimates, strict=True)
    ]
    case = summarize(found, ("friction",))
    assert case["intervals"] == 3
    assert case["covered"] == case["identified"] == pytest.approx(2 / 3)
    assert case["median_error"] == pytest.approx(0.2)
    assert summarize(found, ("stiction",))["intervals"] == 0


@pytest.mark.slow
def test_a_servo_of_another_form_is_identified_but_for_what_only_one_form_has():
    result = identify_servos.main(IdentifyOptions(n=1, first=2, engine="local:1"))
    (found,) = result["servos"]
    assert (found.form, len(found.parameters)) == ("square stiction", 8)
    assert result["cases"]["all"]["covered"] >= 0.75
