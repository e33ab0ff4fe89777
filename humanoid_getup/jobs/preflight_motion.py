"""Judges whether a motion may be played, before torque is on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec

from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_motion, load_world, make_torque_limit
from humanoid_getup.jobs.requests.motions import PreflightRequest
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.preflight import MotionVerdict, Reason
from humanoid_getup.playback.preflight import preflight as judge_motion
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.simulation.world import World
from robots import Robot, TorqueLimit


class JointLoad(msgspec.Struct, frozen=True, kw_only=True):
    """Load of a joint in the rollout."""

    target_speed: float = msgspec.field(name="target_speed_rad_s")
    peak_torque: float = msgspec.field(name="peak_torque_nm")
    rms_torque: float = msgspec.field(name="rms_torque_nm")
    torque_use: float
    saturation: float = msgspec.field(name="saturation_s")
    longest_saturation: float = msgspec.field(name="longest_saturation_s")
    end_temperature: float = msgspec.field(name="end_temperature_c")


class DescribedVerdict(msgspec.Struct, frozen=True, kw_only=True):
    """A verdict with its figures."""

    robot: str
    body: str
    motion: str
    scene: str
    torque_limit: float | None = msgspec.field(name="torque_limit_nm")
    limit_by: str | None
    temperature: float = msgspec.field(name="temperature_c")
    passed: bool
    reasons: tuple[Reason, ...]
    voltage: float = msgspec.field(name="voltage_v")
    duration: float = msgspec.field(name="duration_s")
    succeeded: bool
    stood: bool
    stand_time: float = msgspec.field(name="stand_time_s")
    rises_in_a_row: int | None
    start_overlap: float = msgspec.field(name="start_overlap_m")
    overlap_growth: float = msgspec.field(name="overlap_growth_m")
    joints: dict[str, JointLoad]


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

    def describe(self) -> DescribedVerdict:
        """Describe the verdict for JSON."""
        robot, verdict = self.robot, self.verdict
        figures = verdict.figures
        return DescribedVerdict(
            robot=robot.name,
            body=str(robot.body),
            motion=self.motion.name,
            scene=self.request.scene,
            torque_limit=self.torque_limit.value,
            limit_by=self.torque_limit.by,
            temperature=self.request.temperature,
            passed=verdict.passed,
            reasons=verdict.reasons,
            voltage=figures.voltage,
            duration=figures.duration,
            succeeded=figures.succeeded,
            stood=figures.succeeded and not math.isnan(figures.stand_time),
            stand_time=figures.stand_time,
            rises_in_a_row=figures.rises_in_a_row,
            start_overlap=figures.start_overlap,
            overlap_growth=figures.overlap_growth,
            joints={
                name: JointLoad(
                    **{field: getattr(figures, field)[k] for field in JointLoad.__struct_fields__}
                )
                for k, name in enumerate(robot.joint_names)
            },
        )


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
