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

import importlib
import os
from typing import TYPE_CHECKING, Any

from humanoid_getup.library_environment import prepare

if TYPE_CHECKING:
    from drivers.dynamixel.backend import DynamixelBackend
    from drivers.safety_guard import SafetyGuard
    from drivers.twin.backend import Twin
    from humanoid_getup.execution.get_up import get_up
    from humanoid_getup.execution.keep_stand import keep_stand
    from humanoid_getup.execution.session import SessionOptions
    from humanoid_getup.experiments.starts import sample_fall
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.policy.onnx_policy import OnnxPolicy
    from humanoid_getup.simulation.world import World
    from humanoid_getup.strategies.cached_rise import CachedRise
    from humanoid_getup.strategies.learned_rise import LearnedRise
    from humanoid_getup.strategies.plan_cache import PlanCache
    from humanoid_getup.strategies.planned_rise import PlannedRise
    from humanoid_getup.strategies.stored_motion import StoredMotion
    from humanoid_getup.strategies.styled_rise import StyledRise
    from humanoid_getup.style.curves import StyleCurves
    from humanoid_getup.style.style import Style
    from humanoid_getup.style.style_file import load_style
    from robots.loading import load_robot
    from robots.proportions import Body
    from robots.torque_limit import TorqueLimit

_HOMES = {
    "Body": "robots.proportions",
    "CachedRise": "humanoid_getup.strategies.cached_rise",
    "DynamixelBackend": "drivers.dynamixel.backend",
    "LearnedRise": "humanoid_getup.strategies.learned_rise",
    "Motion": "humanoid_getup.motions.motion",
    "OnnxPolicy": "humanoid_getup.policy.onnx_policy",
    "PlanCache": "humanoid_getup.strategies.plan_cache",
    "PlannedRise": "humanoid_getup.strategies.planned_rise",
    "SafetyGuard": "drivers.safety_guard",
    "SessionOptions": "humanoid_getup.execution.session",
    "StoredMotion": "humanoid_getup.strategies.stored_motion",
    "Style": "humanoid_getup.style.style",
    "StyleCurves": "humanoid_getup.style.curves",
    "StyledRise": "humanoid_getup.strategies.styled_rise",
    "TorqueLimit": "robots.torque_limit",
    "Twin": "drivers.twin.backend",
    "World": "humanoid_getup.simulation.world",
    "get_up": "humanoid_getup.execution.get_up",
    "keep_stand": "humanoid_getup.execution.keep_stand",
    "load_robot": "robots.loading",
    "load_style": "humanoid_getup.style.style_file",
    "sample_fall": "humanoid_getup.experiments.starts",
}

__all__ = [
    "Body",
    "CachedRise",
    "DynamixelBackend",
    "LearnedRise",
    "Motion",
    "OnnxPolicy",
    "PlanCache",
    "PlannedRise",
    "SafetyGuard",
    "SessionOptions",
    "StoredMotion",
    "Style",
    "StyleCurves",
    "StyledRise",
    "TorqueLimit",
    "Twin",
    "World",
    "get_up",
    "keep_stand",
    "load_robot",
    "load_style",
    "sample_fall",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


prepare(os.environ)
