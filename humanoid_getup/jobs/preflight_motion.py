"""Judges whether a motion may be played, before torque is on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_motion, load_world, make_torque_limit
from humanoid_getup.jobs.requests.motions import PreflightRequest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.preflight import MotionVerdict
from humanoid_getup.playback.preflight import preflight as judge_motion
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.simulation.world import World
from robots import Robot, TorqueLimit

LOADS = {
    "target_speed_rad_s": "target_speed",
    "peak_torque_nm": "peak_torque",
    "rms_torque_nm": "rms_torque",
    "torque_use": "torque_use",
    "saturation_s": "saturation",
    "longest_saturation_s": "longest_saturation",
    "end_temperature_c": "end_temperature",
}
"""Figures of each joint, by their keys in JSON."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JudgedMotion:
    """A motion, and the verdict of its preflight."""

    request: PreflightRequest
    world: World
    motion: Motion
    verdict: MotionVerdict
    torque_limit: TorqueLimit

    @property
    def passed(self) -> bool:
        """Return whether the motion may be played."""
        return self.verdict.passed

    @property
    def robot(self) -> Robot:
        """Return the robot that would play it."""
        return self.world.robot

    def describe(self) -> dict[str, Any]:
        """Describe the verdict for JSON."""
        robot, verdict = self.robot, self.verdict
        figures = verdict.figures
        return {
            "robot": robot.name,
            "body": str(robot.body),
            "motion": self.motion.name,
            "scene": self.request.scene,
            "torque_limit_nm": self.torque_limit.value,
            "limit_by": self.torque_limit.by,
            "temperature_c": self.request.temperature,
            "passed": verdict.passed,
            "reasons": verdict.reasons,
            "voltage_v": figures.voltage,
            "duration_s": figures.duration,
            "succeeded": figures.succeeded,
            "stood": figures.succeeded and not math.isnan(figures.stand_time),
            "stand_time_s": figures.stand_time,
            "rises_in_a_row": figures.rises_in_a_row,
            "start_overlap_m": figures.start_overlap,
            "overlap_growth_m": figures.overlap_growth,
            "joints": {
                name: {key: getattr(figures, field)[k] for key, field in LOADS.items()}
                for k, name in enumerate(robot.joint_names)
            },
        }


def preflight(
    request: PreflightRequest, report: Report | None = None, cancel: Cancel | None = None
) -> JudgedMotion:
    """Judge a motion by limits, speed, torque at a supply, heat and self-collision.

    Raises:
        BadInputError: if robot, scene or motion cannot be used.
        CancelledError: if ``cancel`` ended it.
    """
    PreflightRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    world = load_world(request)
    robot, motion = world.robot, find_motion(world.robot, request.motion)
    limit = make_torque_limit(request, robot)
    monitor.begin("rolling out")
    with refusing():
        verdict = judge_motion(
            world,
            motion,
            voltage=robot.supply_voltage if request.voltage is None else request.voltage,
            torque_limit=limit,
            temperature=request.temperature,
        )
    return JudgedMotion(
        request=request, world=world, motion=motion, verdict=verdict, torque_limit=limit
    )
