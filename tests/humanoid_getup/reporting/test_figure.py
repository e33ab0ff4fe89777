"""Figures are PNG files, complete or not there, and matplotlib stays out of the home folder."""

from pathlib import Path

import pytest

from humanoid_getup.reporting.figure import make_figure, open_frame, save_figure

PNG = b"\x89PNG"


def test_a_figure_has_its_size_and_is_a_png(tmp_path: Path):
    figure = make_figure(2.0, 1.0)
    save_figure(figure, tmp_path / "plot.png", dpi=50)
    content = (tmp_path / "plot.png").read_bytes()
    assert content.startswith(PNG)
    width, height = (int.from_bytes(content[at : at + 4]) for at in (16, 20))
    assert (width, height) == (100, 50)


def test_a_figure_that_cannot_be_drawn_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file = tmp_path / "plot.png"
    file.write_bytes(b"old")
    figure = make_figure(2.0, 1.0)
    monkeypatch.setattr(figure, "savefig", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        save_figure(figure, file)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_an_open_frame_has_no_line_above_and_to_the_right():
    axis = make_figure(2.0, 1.0).add_subplot()
    open_frame(axis)
    visible = {side: line.get_visible() for side, line in axis.spines.items()}
    assert visible == {"left": True, "bottom": True, "top": False, "right": False}
