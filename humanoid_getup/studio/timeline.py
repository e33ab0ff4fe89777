"""Timeline: plays a take on the stage, or holds it at the time that is scrubbed to."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from itertools import cycle
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from humanoid_getup.studio.plain_text import escape, make_legend
from humanoid_getup.studio.stage import Picture, Stage
from humanoid_getup.studio.takes import Plot, Take
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser
    from viser import uplot

    from humanoid_getup.simulation.world import World


FRAME = 1.0 / 60.0  # s between two pictures while a take plays
MARK_EVERY = 0.1  # s between two positions of the line in the plots
SPEEDS = {"1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0}
STEP = 0.001  # s, of the slider
REST = 0.5  # s after which a slider that is dragged has come to rest
NUDGE = 1e-6  # s
WIDTH = 340  # pixels


class Timeline:
    """Panel beside the scene; it alone draws on the stage, in a thread of its own.

    Whatever is requested last is shown next: requests between two pictures are skipped.
    """

    def __init__(self, server: viser.ViserServer, stage: Stage) -> None:
        """Add the panel, and begin to draw."""
        self._stage = stage
        self._events = server.get_event_loop()
        self._changed = threading.Condition()
        self.take: Take | None = None
        """What can be scrubbed."""
        self._described: Take | None = None
        self._velocity = np.zeros((0, stage.world.model.nv))
        self._pose: Picture | None = None
        self._at = 0.0  # s since the beginning of the take
        self._clock = self._marked = 0.0  # s, of the last picture and the last line in the plots
        self._wanted = self._playing = self._is_dragged = self._ended = False
        self.shows_start = False
        """Whether the posture that is shown is the one from which a rise starts."""
        self.when_shown: list[Callable[[], None]] = []
        """Called after the start of a rise is shown, or something else again."""
        self.pictures = 0
        """Number of pictures that were drawn."""
        self._add_controls(server.gui)
        self._thread = threading.Thread(target=self._draw, name="timeline", daemon=True)
        self._thread.start()

    @property
    def picture(self) -> Picture | None:
        """Return what is shown, or is to be shown next."""
        with self._changed:
            return self._pose or self._sample()

    def load(self, take: Take, *, play: bool = True) -> None:
        """Show a take from its beginning."""
        velocity = differentiate(self._stage.world, take)
        with self._changed:
            self.take, self._velocity = take, velocity
            self._seek(0.0)
            self._start() if play else self._stop()

    def pose(self, qpos: Array, ghost: Array | None = None, *, is_start: bool = False) -> None:
        """Show a posture at rest, MuJoCo positions (nq,); the take stays on the timeline."""
        with self._changed:
            self._pose = Picture(qpos=qpos, ghost=ghost)
            self._stop()
            self._want()
            self._note_start(is_start=is_start)

    def pause(self) -> None:
        """Stop to play."""
        with self._changed:
            self._stop()

    def scrub(self, seconds: float, *, by_slider: bool = False) -> None:
        """Stop, and show the sample at a time from the beginning of the take [s].

        A slider that is being dragged is left alone: it is ahead of what is drawn.
        """
        with self._changed:
            self._stop()
            self._seek(seconds)
            self._is_dragged = by_slider

    def wait_for(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait up to a time [s] until a condition holds after a picture; return whether it does."""
        with self._changed:
            return self._changed.wait_for(condition, timeout)

    def close(self) -> None:
        """Stop drawing."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._thread.join()

    # Controls ---------------------------------------------------------------------------------

    def _add_controls(self, gui: viser.GuiApi) -> None:
        self.panel = gui.add_panel()
        with self.panel.add_tab("Timeline"):
            self._title = gui.add_markdown("Nothing on the timeline yet.")
            self._slider = gui.add_slider("Time [s]", 0.0, STEP, STEP, 0.0, disabled=True)
            self._button = gui.add_button("Play", disabled=True)
            self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")
            self._facts = gui.add_markdown("")
            self._plots = PlotPanel(gui)
        self.panel.dock_left()
        self.panel.set_width(WIDTH)
        self._button.on_click(lambda _: self._toggle())
        self._slider.on_update(self._slide)

    async def _slide(self, event: viser.GuiEvent) -> None:
        """Scrub to where a person moved the slider."""
        if event.client_id is not None:  # moved by a person, not by the playback
            self.scrub(self._slider.value, by_slider=True)

    def _move_slider(self, nudge: float = 0.0) -> None:
        """Move the slider to the time that is shown [s], unless it is being dragged."""
        with self._changed:
            if not (self._is_dragged or self._ended):
                self._slider.value = min(self._at, self._slider.max) + nudge

    def _toggle(self) -> None:
        with self._changed:
            if self._playing:
                self._stop()
            elif self.take is not None:
                self._seek(0.0 if self._at >= self.take.duration else self._at)
                self._start()

    def _describe(self, take: Take) -> None:
        """Show name, facts, marks and plots of a take."""
        self._title.content = f"**{escape(take.name)}**"
        self._slider.max, self._slider.disabled = max(take.duration, STEP), False
        self._button.disabled = False
        begin = float(take.time[0])
        marks = [f"{mark.time - begin:.2f} s: {mark.text}" for mark in take.marks]
        self._facts.content = "\n\n".join(map(escape, [*take.facts, *marks]))
        self._plots.show(take)
        self._described = take

    # State, under the lock --------------------------------------------------------------------

    def _start(self) -> None:
        self._playing, self._clock = True, time.perf_counter()
        self._button.label = "Pause"
        self._want()

    def _stop(self) -> None:
        self._playing = False
        self._button.label = "Play"

    def _seek(self, seconds: float) -> None:
        self._at, self._pose, self._is_dragged = seconds, None, False
        self._want()
        self._note_start(is_start=False)

    def _note_start(self, *, is_start: bool) -> None:
        if is_start is not self.shows_start:
            self.shows_start = is_start
            for update in self.when_shown:
                update()

    def _want(self) -> None:
        self._wanted = True
        self._changed.notify_all()

    def _sample(self) -> Picture | None:
        """Return the sample of the take at the present time."""
        if (take := self.take) is None:
            return None
        row = take.find(self._at)
        return Picture(
            qpos=take.qpos[row],
            ghost=None if take.ghost is None else take.ghost[row],
            velocity=self._velocity[row],
            joint_torque=None if take.joint_torque is None else take.joint_torque[row],
        )

    def _advance(self) -> None:
        """Advance the time of a take that plays; stop at its end."""
        take, now = self.take, time.perf_counter()
        if take is None or not self._playing:
            return
        self._at += (now - self._clock) * SPEEDS.get(self._speed.value, 1.0)
        self._clock = now
        if self._at >= take.duration:
            self._at = take.duration
            self._stop()

    # Drawing ----------------------------------------------------------------------------------

    def _draw(self) -> None:
        """Draw until the end: while a take plays at a steady rate, else what is requested."""
        while True:
            with self._changed:
                if not self._wait():
                    return
                self._wanted = False
                self._advance()
                picture, playing = self._pose or self._sample(), self._playing
                take = self.take
            try:
                self._show(take, picture)
            except Exception as error:  # one picture is missing, the next one may not be
                self._title.content = escape(f"not drawn: {type(error).__name__}: {error}")
            with self._changed:
                self.pictures += 1
                self._changed.notify_all()
            if playing:
                time.sleep(FRAME)

    def _show(self, take: Take | None, picture: Picture | None) -> None:
        if take is not None and take is not self._described:
            self._describe(take)
        if picture is not None:
            self._stage.show(picture)
        if take is not None and self._pose is None:
            self._show_time(take)

    def _wait(self) -> bool:
        """Wait for what is to be drawn; return whether there is something, not the end."""
        rest = REST if self._is_dragged else None
        if not self._changed.wait_for(lambda: self._wanted or self._playing or self._ended, rest):
            self._is_dragged = False
            self._events.call_soon_threadsafe(self._move_slider, NUDGE)  # what is equal is not sent
        return not self._ended

    def _show_time(self, take: Take) -> None:
        """Move the slider, and the line in the plots, to the time that is shown."""
        now = time.perf_counter()
        self._events.call_soon_threadsafe(self._move_slider)
        if not self._playing or now - self._marked >= MARK_EVERY:
            self._marked = now
            self._plots.mark(float(take.time[0]) + self._at)


def differentiate(world: World, take: Take) -> Array:
    """Compute the MuJoCo velocities of a take, (T, nv), from each sample and the one before it."""
    velocity = np.zeros((len(take.time), world.model.nv))
    for row, step in enumerate(np.diff(take.time), start=1):
        if step > 0.0:
            before, after = take.qpos[row - 1], take.qpos[row]
            mujoco.mj_differentiatePos(world.model, velocity[row], step, before, after)
    return velocity


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
