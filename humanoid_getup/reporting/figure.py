"""Figures: made without a window, saved as PNG completely or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from robots.storage.files import atomic_path

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def make_figure(
    width: float, height: float, *, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
    """Make an empty white figure of a size [inch]."""
    keep_matplotlib_out_of_home()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def open_frame(axes: Axes) -> None:
    """Remove the upper and the right line of the frame."""
    axes.spines[["top", "right"]].set_visible(False)


def save_figure(figure: Figure, file: Path, *, dpi: int = 150) -> None:
    """Save a figure as PNG."""
    with atomic_path(file) as partial:
        figure.savefig(partial, dpi=dpi, format="png")
