"""What libraries read from the environment as they are imported."""

from __future__ import annotations

import sys
from collections.abc import MutableMapping

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")


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
