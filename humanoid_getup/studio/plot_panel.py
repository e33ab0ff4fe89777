"""Plot panel: the curves of a take over time, with a line at the time that is shown."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.studio.plain_text import make_legend
from humanoid_getup.studio.takes import Plot, Take
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser
    from viser import uplot

HEIGHT = 150  # pixels
MOST_POINTS = 500  # of a curve
MARGIN, LEAST_MARGIN = 0.05, 0.5  # of an axis: share of its values' span, and without a span
COLORS = ("#2f6fde", "#d9822b", "#2ca02c", "#9467bd", "#8c564b", "#e377c2", "#17becf", "#7f7f7f")
LINE, LIMIT = "#222222", "#d62728"


class PlotPanel:
    """Draws the plots of a take in a folder of the page; one thread alone calls it."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Add an empty folder where the caller is adding elements."""
        self._gui, self._folder = gui, gui.add_folder("Plots")
        self.plots: list[_DrawnPlot] = []

    def show(self, take: Take) -> None:
        """Replace the plots by those of a take."""
        for plot in self.plots:
            plot.remove()
        with self._folder:
            self.plots = [_DrawnPlot(self._gui, take, plot) for plot in take.plots]

    def mark(self, time: float) -> None:
        """Draw the line at a time of the take [s], and write the values there."""
        for plot in self.plots:
            plot.mark(time)


class _DrawnPlot:
    """A chart, whose samples are thinned out, and its line."""

    def __init__(self, gui: viser.GuiApi, take: Take, plot: Plot) -> None:
        kept = np.unique(np.linspace(0, len(take.time) - 1, MOST_POINTS).round().astype(int))
        self._time = take.time[kept]
        self._curves = {name: values[kept] for name, values in plot.curves.items()}
        if plot.limit is not None:
            self._curves["limit"] = np.full(len(kept), plot.limit)
        self._range = find_range(np.concatenate(list(self._curves.values())))
        self.chart = gui.add_uplot(
            self._place(float(take.time[0])),
            ({"label": "s"}, *self._style()),
            legend={"show": False},
            title=plot.title,
            # Without a range, one sample that is not known hides all that are.
            scales={"x": {"time": False}, "y": {"range": self._range}},
            height=HEIGHT,
        )
        self.legend = gui.add_html("")
        self._write(float(take.time[0]))

    def mark(self, time: float) -> None:
        """Move the line to a time [s], and show the values there."""
        self.chart.data = self._place(time)
        self._write(time)

    def remove(self) -> None:
        """Remove it from the page."""
        self.chart.remove()
        self.legend.remove()

    def _write(self, time: float) -> None:
        """Write the values of the last sample at or before a time [s] into the legend."""
        row = max(int(np.searchsorted(self._time, time + 1e-9, side="right")) - 1, 0)
        now = {name: each[row] for name, each in self._curves.items()}
        values = {name: f"{v:.3g}" if np.isfinite(v) else "–" for name, v in now.items()}
        self.legend.content = make_legend(values, self._colors)

    @property
    def _colors(self) -> dict[str, str]:
        colors: dict[str, str] = dict(zip(self._curves, cycle(COLORS), strict=False))
        return colors | ({"limit": LIMIT} if "limit" in self._curves else {})

    def _style(self) -> list[uplot.Series]:
        colors = self._colors | {"now": LINE}
        return [{"label": name, "stroke": color, "width": 1.5} for name, color in colors.items()]

    def _place(self, time: float) -> tuple[Array, ...]:
        """Return times and curves with two samples more, between which the line is drawn."""
        at = int(np.searchsorted(self._time, time))
        line = np.full(len(self._time), np.nan)
        return (
            np.insert(self._time, at, [time, time]),
            *(
                np.insert(values, at, [np.interp(time, self._time, values)] * 2)
                for values in self._curves.values()
            ),
            np.insert(line, at, self._range),
        )


def find_range(values: Array) -> tuple[float, float]:
    """Find the range of an axis with a margin around its values, of which some may be unknown."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    margin = MARGIN * (high - low) or LEAST_MARGIN
    return low - margin, high + margin
