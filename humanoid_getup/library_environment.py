"""What libraries read from the environment as they are imported."""

from __future__ import annotations

import os
import sys
from collections.abc import MutableMapping
from pathlib import Path

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
MATPLOTLIB_FOLDER = "MPLCONFIGDIR"
"""Variable that names where matplotlib has its settings and its list of fonts."""


def prepare(environment: MutableMapping[str, str]) -> None:
    """Set variables of MuJoCo, Mesa and onnxruntime that the user has not set.

    MuJoCo renders without a display. Neither Mesa nor onnxruntime writes into the user's cache
    folder, and onnxruntime, which otherwise looks for a telemetry server, sends nothing.
    """
    environment.setdefault("ORT_DISABLE_TELEMETRY", "1")
    if sys.platform == "linux":
        environment.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
        if not any(environment.get(name) for name in DISPLAYS):
            environment.setdefault("MUJOCO_GL", "egl")


def keep_matplotlib_out_of_home() -> None:
    """Keep matplotlib from making folders in the home of a user who has none of it there.

    It makes them as it is imported; those made here instead last as long as the program.
    """
    if "matplotlib" in sys.modules or MATPLOTLIB_FOLDER in os.environ:
        return
    home = Path.home()
    config = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config", "matplotlib")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache", "matplotlib")
    if any(folder.exists() for folder in (config, cache, home / ".matplotlib")):
        return
    import atexit  # take time before a program handles signals
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="getup-matplotlib-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[MATPLOTLIB_FOLDER] = folder
