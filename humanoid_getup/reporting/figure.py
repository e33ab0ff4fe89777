"""Figures: made without a window, saved as PNG completely or not at all."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from robots.files import atomic_path

if TYPE_CHECKING:  # matplotlib is slow to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FOLDER_VARIABLE = "MPLCONFIGDIR"  # of matplotlib: where its settings and its list of fonts are


def make_figure(
    width: float, height: float, *, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
    """Make an empty white figure of a size [inch]."""
    keep_out_of_home()
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def open_frame(axes: Axes) -> None:
    """Remove the upper and the right line of the frame."""
    axes.spines[["top", "right"]].set_visible(False)


def save_figure(figure: Figure, file: Path, *, dpi: int = 150) -> None:
    """Save a figure as PNG."""
    with atomic_path(file) as partial:
        figure.savefig(partial, dpi=dpi, format="png")


def keep_out_of_home() -> None:
    """Keep matplotlib from making folders in the home of a user who has none of it there.

    It makes them as it is imported; those made here instead last as long as the program.
    """
    if "matplotlib" in sys.modules or FOLDER_VARIABLE in os.environ:
        return
    home = Path.home()
    config = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config", "matplotlib")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache", "matplotlib")
    if any(folder.exists() for folder in (config, cache, home / ".matplotlib")):
        return
    folder = tempfile.mkdtemp(prefix="getup-matplotlib-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[FOLDER_VARIABLE] = folder
