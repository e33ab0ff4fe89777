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
    from humanoid_getup.experiments.starts.falls import sample_fall
    from humanoid_getup.jobs.benchmark import benchmark
    from humanoid_getup.jobs.build_motions import build_motions
    from humanoid_getup.jobs.check_policy import check_policy
    from humanoid_getup.jobs.check_robot import check_robot
    from humanoid_getup.jobs.discover_motions import discover, discover_all
    from humanoid_getup.jobs.evaluate_policy import evaluate
    from humanoid_getup.jobs.export_log import export_log
    from humanoid_getup.jobs.export_motion import export_motion
    from humanoid_getup.jobs.export_robot import export_robot
    from humanoid_getup.jobs.extract_style import extract_style
    from humanoid_getup.jobs.get_up.rise import play_motion, rise, run_policy
    from humanoid_getup.jobs.get_up.stand import hold, sit
    from humanoid_getup.jobs.get_up.watch import watch
    from humanoid_getup.jobs.import_clip import import_clip
    from humanoid_getup.jobs.import_keys import import_keys
    from humanoid_getup.jobs.import_policy import import_policy
    from humanoid_getup.jobs.import_robot import import_robot
    from humanoid_getup.jobs.make_prior import make_prior
    from humanoid_getup.jobs.measure_robot import measure_robot
    from humanoid_getup.jobs.plan_path import plan
    from humanoid_getup.jobs.preflight_motion import preflight
    from humanoid_getup.jobs.preview_motion import preview
    from humanoid_getup.jobs.replay_flight import replay_flight
    from humanoid_getup.jobs.requests.bench import (
        BenchAll,
        BenchRise,
    )
    from humanoid_getup.jobs.requests.learning import (
        EvaluateRequest,
        ExportRequest,
        PriorRequest,
        TrainRequest,
    )
    from humanoid_getup.jobs.requests.logs import ExportLogRequest
    from humanoid_getup.jobs.requests.motions import (
        BuildRequest,
        ClipRequest,
        DiscoverRequest,
        ExportMotionRequest,
        ImportKeysRequest,
        PreflightRequest,
        PreviewRequest,
        RetargetRequest,
    )
    from humanoid_getup.jobs.requests.plan import PlanRequest
    from humanoid_getup.jobs.requests.policies import (
        CheckPolicyRequest,
        ImportPolicyRequest,
    )
    from humanoid_getup.jobs.requests.replay import ReplayRequest
    from humanoid_getup.jobs.requests.rise import (
        HoldRequest,
        PlayRequest,
        RiseRequest,
        RunRequest,
        SitRequest,
    )
    from humanoid_getup.jobs.requests.robots import (
        CheckRequest,
        ExportRobotRequest,
        ImportRequest,
    )
    from humanoid_getup.jobs.requests.style import ExtractRequest
    from humanoid_getup.jobs.requests.watch import WatchRequest
    from humanoid_getup.jobs.retarget_motions import retarget
    from humanoid_getup.jobs.train_policy import export, train
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.policy.onnx_policy import OnnxPolicy
    from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor
    from humanoid_getup.simulation.world import World
    from humanoid_getup.strategies.learned_rise import LearnedRise
    from humanoid_getup.strategies.planned_rise import PlannedRise
    from humanoid_getup.strategies.stored_motion import StoredMotion
    from humanoid_getup.strategies.styled_rise import StyledRise
    from humanoid_getup.style.curves import StyleCurves
    from humanoid_getup.style.style import Style
    from humanoid_getup.style.style_file import load_style
    from robots.description.loading import load_robot
    from robots.proportions import Body
    from robots.torque_limit import TorqueLimit

_HOMES = {
    "BenchAll": "humanoid_getup.jobs.requests.bench",
    "BenchRise": "humanoid_getup.jobs.requests.bench",
    "Body": "robots.proportions",
    "BuildRequest": "humanoid_getup.jobs.requests.motions",
    "CancelledError": "humanoid_getup.progress.callback",
    "CheckPolicyRequest": "humanoid_getup.jobs.requests.policies",
    "CheckRequest": "humanoid_getup.jobs.requests.robots",
    "ClipRequest": "humanoid_getup.jobs.requests.motions",
    "DiscoverRequest": "humanoid_getup.jobs.requests.motions",
    "DynamixelBackend": "drivers.dynamixel.backend",
    "EvaluateRequest": "humanoid_getup.jobs.requests.learning",
    "ExportLogRequest": "humanoid_getup.jobs.requests.logs",
    "ExportMotionRequest": "humanoid_getup.jobs.requests.motions",
    "ExportRequest": "humanoid_getup.jobs.requests.learning",
    "ExportRobotRequest": "humanoid_getup.jobs.requests.robots",
    "ExtractRequest": "humanoid_getup.jobs.requests.style",
    "HoldRequest": "humanoid_getup.jobs.requests.rise",
    "ImportKeysRequest": "humanoid_getup.jobs.requests.motions",
    "ImportPolicyRequest": "humanoid_getup.jobs.requests.policies",
    "ImportRequest": "humanoid_getup.jobs.requests.robots",
    "LearnedRise": "humanoid_getup.strategies.learned_rise",
    "Motion": "humanoid_getup.motions.motion",
    "OnnxPolicy": "humanoid_getup.policy.onnx_policy",
    "PlanRequest": "humanoid_getup.jobs.requests.plan",
    "PlannedRise": "humanoid_getup.strategies.planned_rise",
    "PlayRequest": "humanoid_getup.jobs.requests.rise",
    "PreflightRequest": "humanoid_getup.jobs.requests.motions",
    "PreviewRequest": "humanoid_getup.jobs.requests.motions",
    "PriorRequest": "humanoid_getup.jobs.requests.learning",
    "Progress": "humanoid_getup.progress.callback",
    "ProgressMonitor": "humanoid_getup.progress.callback",
    "ReplayRequest": "humanoid_getup.jobs.requests.replay",
    "RetargetRequest": "humanoid_getup.jobs.requests.motions",
    "RiseRequest": "humanoid_getup.jobs.requests.rise",
    "RunRequest": "humanoid_getup.jobs.requests.rise",
    "SafetyGuard": "drivers.safety_guard",
    "SessionOptions": "humanoid_getup.execution.session",
    "SitRequest": "humanoid_getup.jobs.requests.rise",
    "StoredMotion": "humanoid_getup.strategies.stored_motion",
    "Style": "humanoid_getup.style.style",
    "StyleCurves": "humanoid_getup.style.curves",
    "StyledRise": "humanoid_getup.strategies.styled_rise",
    "TorqueLimit": "robots.torque_limit",
    "TrainRequest": "humanoid_getup.jobs.requests.learning",
    "Twin": "drivers.twin.backend",
    "WatchRequest": "humanoid_getup.jobs.requests.watch",
    "World": "humanoid_getup.simulation.world",
    "benchmark": "humanoid_getup.jobs.benchmark",
    "build_motions": "humanoid_getup.jobs.build_motions",
    "check_policy": "humanoid_getup.jobs.check_policy",
    "check_robot": "humanoid_getup.jobs.check_robot",
    "discover": "humanoid_getup.jobs.discover_motions",
    "discover_all": "humanoid_getup.jobs.discover_motions",
    "evaluate": "humanoid_getup.jobs.evaluate_policy",
    "export": "humanoid_getup.jobs.train_policy",
    "export_log": "humanoid_getup.jobs.export_log",
    "export_motion": "humanoid_getup.jobs.export_motion",
    "export_robot": "humanoid_getup.jobs.export_robot",
    "extract_style": "humanoid_getup.jobs.extract_style",
    "get_up": "humanoid_getup.execution.get_up",
    "hold": "humanoid_getup.jobs.get_up.stand",
    "import_clip": "humanoid_getup.jobs.import_clip",
    "import_keys": "humanoid_getup.jobs.import_keys",
    "import_policy": "humanoid_getup.jobs.import_policy",
    "import_robot": "humanoid_getup.jobs.import_robot",
    "keep_stand": "humanoid_getup.execution.keep_stand",
    "load_robot": "robots.description.loading",
    "load_style": "humanoid_getup.style.style_file",
    "make_prior": "humanoid_getup.jobs.make_prior",
    "measure_robot": "humanoid_getup.jobs.measure_robot",
    "plan": "humanoid_getup.jobs.plan_path",
    "play_motion": "humanoid_getup.jobs.get_up.rise",
    "preflight": "humanoid_getup.jobs.preflight_motion",
    "preview": "humanoid_getup.jobs.preview_motion",
    "replay_flight": "humanoid_getup.jobs.replay_flight",
    "retarget": "humanoid_getup.jobs.retarget_motions",
    "rise": "humanoid_getup.jobs.get_up.rise",
    "run_policy": "humanoid_getup.jobs.get_up.rise",
    "sample_fall": "humanoid_getup.experiments.starts.falls",
    "sit": "humanoid_getup.jobs.get_up.stand",
    "train": "humanoid_getup.jobs.train_policy",
    "watch": "humanoid_getup.jobs.get_up.watch",
}

__all__ = [
    "BenchAll",
    "BenchRise",
    "Body",
    "BuildRequest",
    "CancelledError",
    "CheckPolicyRequest",
    "CheckRequest",
    "ClipRequest",
    "DiscoverRequest",
    "DynamixelBackend",
    "EvaluateRequest",
    "ExportLogRequest",
    "ExportMotionRequest",
    "ExportRequest",
    "ExportRobotRequest",
    "ExtractRequest",
    "HoldRequest",
    "ImportKeysRequest",
    "ImportPolicyRequest",
    "ImportRequest",
    "LearnedRise",
    "Motion",
    "OnnxPolicy",
    "PlanRequest",
    "PlannedRise",
    "PlayRequest",
    "PreflightRequest",
    "PreviewRequest",
    "PriorRequest",
    "Progress",
    "ProgressMonitor",
    "ReplayRequest",
    "RetargetRequest",
    "RiseRequest",
    "RunRequest",
    "SafetyGuard",
    "SessionOptions",
    "SitRequest",
    "StoredMotion",
    "Style",
    "StyleCurves",
    "StyledRise",
    "TorqueLimit",
    "TrainRequest",
    "Twin",
    "WatchRequest",
    "World",
    "benchmark",
    "build_motions",
    "check_policy",
    "check_robot",
    "discover",
    "discover_all",
    "evaluate",
    "export",
    "export_log",
    "export_motion",
    "export_robot",
    "extract_style",
    "get_up",
    "hold",
    "import_clip",
    "import_keys",
    "import_policy",
    "import_robot",
    "keep_stand",
    "load_robot",
    "load_style",
    "make_prior",
    "measure_robot",
    "plan",
    "play_motion",
    "preflight",
    "preview",
    "replay_flight",
    "retarget",
    "rise",
    "run_policy",
    "sample_fall",
    "sit",
    "train",
    "watch",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


prepare(os.environ)
