"""Plots show what they are made of: the joints that matter by name, limits, and divergence."""

from types import SimpleNamespace

import numpy as np
import pytest

from humanoid_getup.experiments.judging.torque import split_torque
from humanoid_getup.reporting import plots
from humanoid_getup.reporting.plots import save_torque
from robots import Robot

T = 50


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list:
    saved: list = []
    monkeypatch.setattr(plots, "save_figure", lambda figure, _path: saved.append(figure))
    return saved


def test_driving_and_braking_torque_are_apart(figures: list, tmp_path, tiny: Robot):
    """The first joint drives with 1 N·m, the second brakes with 2 N·m."""
    torque, speed = np.tile([1.0, -2.0], (T, 1)), np.tile([1.0, 1.0], (T, 1))
    torques = split_torque(torque, speed)
    outcome = SimpleNamespace(torques=torques, stood=True, stand_time=0.2)
    save_torque(tiny, outcome, 1.5, tmp_path / "plot.png")
    (axis,) = figures[0].axes
    lines = {line.get_label(): line.get_ydata() for line in axis.get_lines()}
    assert lines["l_hip"] == pytest.approx(np.ones(T))
    assert lines["r_hip"] == pytest.approx(np.zeros(T))
    assert lines["braking, any"] == pytest.approx(np.full(T, 2.0))
    assert [text.get_text() for text in axis.texts] == ["limit 1.5 N·m", " stands"]
