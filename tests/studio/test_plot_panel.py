"""Plots of a take, and the line in them."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")

from humanoid_getup.studio.takes import Plot, Take
from humanoid_getup.studio.timeline import PlotPanel, find_range


class Chart:
    """Stands in for a chart of viser, and for a text."""

    def __init__(self) -> None:
        self.data: tuple[np.ndarray, ...] = ()
        self.content = ""

    def remove(self) -> None:
        pass


class Folder:
    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass


def make_panel() -> PlotPanel:
    gui: Any = SimpleNamespace(
        add_folder=lambda _: Folder(),
        add_uplot=lambda *_, **__: Chart(),
        add_html=lambda _: Chart(),
    )
    return PlotPanel(gui)


def make_take(curves: int) -> Take:
    time = np.linspace(0.0, 1.0, 500)
    plots = tuple(Plot(title=f"{k}", curves={"a": time, "b": time}) for k in range(curves))
    return Take(name="take", time=time, qpos=np.zeros((500, 7)), plots=plots)


@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
def test_a_line_stands_at_the_time_that_is_shown_among_rising_times(at: float):
    panel = make_panel()
    panel.show(make_take(1))
    panel.mark(at)
    time, *_, line = panel.plots[0].chart.data
    assert np.all(np.diff(time) >= 0.0)
    np.testing.assert_array_equal(time[np.isfinite(line)], [at, at])


def test_the_legend_has_the_values_at_the_line():
    panel, time = make_panel(), np.array([0.0, 1.0, 2.0])
    curves = {"knee <b>": np.array([0.0, 1.25, 3.0]), "hip": np.array([np.nan, np.nan, 4.0])}
    plot = Plot(title="Torque", curves=curves, limit=2.0)
    panel.show(Take(name="take", time=time, qpos=np.zeros((3, 7)), plots=(plot,)))
    for at, shown in ((1.0, "1.25 – 2"), (1.9, "1.25 – 2"), (2.0, "3 4 2")):
        panel.mark(at)
        knee, hip, limit = shown.split()
        text = re.sub("<[^>]*>", "", panel.plots[0].legend.content)
        assert text == f"■ knee &lt;b&gt; {knee} ■ hip {hip} ■ limit {limit}"


def test_an_axis_has_a_margin_and_leaves_unknown_values_out():
    wide = {(0.0, 2.0): (-0.1, 2.1), (3.0, 3.0): (2.5, 3.5), (np.nan, 1.0): (0.5, 1.5)}
    for values, wanted in wide.items():
        assert find_range(np.array(values)) == pytest.approx(wanted)
    low, high = find_range(np.full(3, np.nan))
    assert low < high
