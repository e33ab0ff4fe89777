"""Get fallen humanoids up, on a twin, a virtual servo bus or a robot.

    import humanoid_getup as hg

    robot = hg.load_robot("op3")
    world = hg.World(robot)
    fall = hg.sample_fall(world, "prone", seed=1)
    with hg.Twin(world, fall.posture) as twin:
        result = hg.get_up(twin, hg.PlannedRise(world))
    print(result)

Each name is imported when it is first used.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from typing import Any

from humanoid_getup.library_environment import prepare

_STUB = Path(__file__).with_suffix(".pyi").read_text("utf-8")
_HOMES = {
    words[-1]: words[1]  # from module import name as name
    for words in map(str.split, _STUB.splitlines())
    if words[:1] == ["from"]
}
__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]  (the stub has it)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


prepare(os.environ)
