from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.experiments.judging.outcome import DEEP_OVERLAP
from humanoid_getup.motions.preference import PREFERENCE_NAMES, Preference

FIGURES = ("stand_time", "peak_torque", "rms_torque", "neck_delta_v", "overlap")
amounts = st.floats(0.0, 10.0)


@dataclass(frozen=True)
class Figures:
    """What a preference weighs."""

    stand_time: np.ndarray
    peak_torque: np.ndarray
    rms_torque: np.ndarray
    neck_delta_v: np.ndarray
    overlap: np.ndarray
    peak_braking_torque: float = 0.0

    @property
    def collides(self) -> np.ndarray:
        return self.overlap > DEEP_OVERLAP


def make_figures(*values: float) -> Figures:
    return Figures(*(np.array([value]) for value in values))


@pytest.mark.parametrize("name", PREFERENCE_NAMES)
@given(values=st.tuples(*[amounts] * 5), figure=st.sampled_from(FIGURES), more=st.floats(0.01, 5.0))
def test_no_figure_that_grows_makes_a_rise_cheaper(name, values, figure, more):
    preference, figures = Preference.of(name), make_figures(*values)
    worse = replace(figures, **{figure: getattr(figures, figure) + more})
    assert preference.cost(worse)[0] >= preference.cost(figures)[0]


def test_a_preference_counts_most_what_it_is_named_after():
    """Beside a share of what is usual: 3 s, 4 N·m, 0.5 N·m, 0.3 m/s."""
    usual = make_figures(3.0, 4.0, 0.5, 0.3, 0.0)
    names = {"stand_time": "time", "rms_torque": "torque", "neck_delta_v": "impact"}
    for figure, name in names.items():
        cost = Preference.of(name).cost
        less = {f: replace(usual, **{f: 0.9 * getattr(usual, f)}) for f in names}
        spared = {f: cost(usual)[0] - cost(fewer)[0] for f, fewer in less.items()}
        assert max(spared, key=spared.__getitem__) == figure, name


def test_touching_itself_firmly_costs_a_second():
    free, firm = (make_figures(3.0, 4.0, 0.5, 0.3, share * DEEP_OVERLAP) for share in (0.9, 1.1))
    assert (free.collides[0], firm.collides[0]) == (False, True)
    for name in PREFERENCE_NAMES:
        cost = Preference.of(name).cost
        assert cost(firm)[0] > cost(free)[0] + 0.99, name
