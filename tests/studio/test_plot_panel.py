"""Plots are replaced while the line in them moves."""

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")

from humanoid_getup.studio.plot_panel import PlotPanel, widen
from humanoid_getup.studio.take import Plot, Take


class Chart:
    """A chart that refuses data once it is removed, as those of viser do."""

    def __init__(self) -> None:
        self.removed = False

    def remove(self) -> None:
        self.removed = True

    def __setattr__(self, name: str, value: Any) -> None:
        assert name != "data" or not self.removed
        super().__setattr__(name, value)


class Folder:
    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass


def make_panel() -> PlotPanel:
    gui: Any = SimpleNamespace(add_folder=lambda _: Folder(), add_uplot=lambda *_, **__: Chart())
    return PlotPanel(gui)


def make_take(curves: int) -> Take:
    time = np.linspace(0.0, 1.0, 500)
    plots = tuple(Plot(title=f"{k}", curves={"a": time, "b": time}) for k in range(curves))
    return Take(name="take", time=time, qpos=np.zeros((500, 7)), plots=plots)


def test_a_line_is_never_drawn_in_a_plot_that_was_replaced():
    panel, problems, ended = make_panel(), list[BaseException](), threading.Event()

    def draw() -> None:
        try:
            while not ended.is_set():
                panel.mark(0.5)
        except BaseException as error:
            problems.append(error)

    panel.show(make_take(3))
    thread = threading.Thread(target=draw)
    thread.start()
    for k in range(100):
        panel.show(make_take(1 + k % 3))
    ended.set()
    thread.join()
    assert not problems


@pytest.mark.parametrize(("bounds", "wide"), [((0.0, 2.0), (-0.1, 2.1)), ((3.0, 3.0), (2.5, 3.5))])
def test_an_axis_has_a_margin(bounds, wide):
    assert widen(bounds) == pytest.approx(wide)
