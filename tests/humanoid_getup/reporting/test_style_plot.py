"""Plots of styles: in degrees, by name, with a gap where nothing was followed."""

from types import SimpleNamespace

import numpy as np
import pytest

from humanoid_getup.reporting import style_plot
from humanoid_getup.reporting.style_plot import save_flight, save_styles
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import load_style
from robots import Robot

RIGHT = np.pi / 2


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list:
    saved: list = []
    monkeypatch.setattr(style_plot, "save_figure", lambda figure, *_, **__: saved.append(figure))
    return saved


def test_a_style_of_several_curves_is_a_mean_with_a_band(figures: list, tmp_path, op3: Robot):
    curve = load_style("long-sit", op3).curves[0]
    one, two = (Style(name=name, curves=(curve,) * k) for name, k in (("one", 1), ("two", 2)))
    save_styles([one, two], tmp_path / "plot.png")
    height = figures[0].axes[0]
    named = [line for line in height.get_lines() if not line.get_label().startswith("_")]
    assert [line.get_label() for line in named] == ["one", "two (2 curves)"]
    assert named[0].get_ydata() == pytest.approx(named[1].get_ydata())
    assert named[0].get_ydata()[-1] == pytest.approx(curve.points[-1, 0])
    assert len(height.collections) == 1  # the band of the second


def test_a_flight_has_a_gap_between_attempts_and_no_plot_without_a_style(figures: list, tmp_path):
    times = np.array([0.0, 0.1, 0.2, 3.0, 3.1])
    features = np.tile([0.5, RIGHT, RIGHT], (5, 1))

    class Guidance(dict):
        cycle = np.array([0, 1, 2, 40, 41])  # those between are lost

    guided = Guidance(wanted=features, measured=features)
    state = SimpleNamespace(cycle=Guidance.cycle)
    record = SimpleNamespace(time=times, state=state, tracks={"guidance": guided})
    save_flight(record, tmp_path / "plot.png")
    drawn = figures[0].axes[0].get_lines()[0].get_ydata()
    assert np.isnan(drawn).tolist() == [False, False, True, False, False]
    assert np.isfinite(features).all(), "the record was changed"
    save_flight(SimpleNamespace(time=times, tracks={}), tmp_path / "plot.png")
    assert len(figures) == 1
