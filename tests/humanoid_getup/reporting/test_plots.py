"""Plots show what they are made of: the joints that matter by name, limits, and divergence."""

from types import SimpleNamespace

import numpy as np
import pytest

from humanoid_getup.experiments.judging.torque import split_torque
from humanoid_getup.reporting import plots
from humanoid_getup.reporting.plots import save_difference, save_torque
from humanoid_getup.reporting.replay import ReplayReport
from robots import Robot

T = 50
NAMES = tuple(f"joint_{k}" for k in range(10))


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list:
    """Collect figures that would be saved."""
    saved: list = []
    monkeypatch.setattr(plots, "save_figure", lambda figure, _path: saved.append(figure))
    return saved


def make_report(difference: np.ndarray) -> ReplayReport:
    return ReplayReport(
        robot="robot",
        joint_names=NAMES,
        time=np.arange(T) * 0.01,
        difference=difference,
        tilt_difference=np.zeros(T),
        threshold=0.05,
        twin_qpos=np.zeros((T, 7)),
    )


def test_a_divergence_is_marked_at_its_time(figures: list, tmp_path):
    difference = np.zeros((T, len(NAMES)))
    difference[30:, 4] = 0.2
    save_difference(make_report(difference), tmp_path / "plot.png")
    marked = [line for line in figures[0].axes[1].get_lines() if line.get_color() == "tab:red"]
    assert [float(line.get_xdata()[0]) for line in marked] == pytest.approx([0.3])
    save_difference(make_report(np.zeros((T, len(NAMES)))), tmp_path / "plot.png")
    assert all(line.get_color() != "tab:red" for line in figures[1].axes[1].get_lines())


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
