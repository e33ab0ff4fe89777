"""`getup preflight`: judge whether a motion may be played, before torque is on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.console import make_table
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, refusing
from humanoid_getup.commands.inputs import find_motion, load_world, make_torque_limit
from humanoid_getup.commands.options import LoadOption, MotionName, SceneOptions, TorqueOptions
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback import preflight as judging
from humanoid_getup.playback.preflight import MotionVerdict, ReasonKind
from humanoid_getup.playback.preflight_rollout import MOST_RISES
from humanoid_getup.playback.simulated_play import describe_end
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.simulation.world import World
from robots import TorqueLimit
from robots.storage.validation import between

HEADINGS = ("joint", "peak N·m", "of limit", "RMS N·m", "saturated s", "after °C")
SHOWN = 6  # joints in the table, the most loaded first
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


@dataclass(frozen=True, kw_only=True)
class PreflightRequest(TorqueOptions, LoadOption, SceneOptions):
    """Check a motion against limits, speed, torque at a supply, heat and self-collision."""

    motion: Positional[MotionName]
    voltage: Annotated[float | None, between(1.0, 100.0, "V"), arg(metavar="V")] = None
    """Supply voltage at the servos [V]; default: the robot's nominal one."""
    temperature: Annotated[float, between(-50.0, 150.0, "°C"), arg(metavar="°C")] = 25.0
    """Temperature of all servos before the rise [°C]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JudgedMotion:
    """A motion, and the verdict of its preflight."""

    request: PreflightRequest
    world: World
    motion: Motion
    verdict: MotionVerdict
    torque_limit: TorqueLimit

    def describe(self) -> dict[str, Any]:
        """Describe the verdict for JSON."""
        robot, verdict = self.world.robot, self.verdict
        figures = verdict.figures
        return {
            "robot": robot.name,
            "body": str(robot.body),
            "load": robot.load or None,
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


@command("preflight", json=JudgedMotion.describe)
def preflight(request: PreflightRequest, monitor: ProgressMonitor) -> JudgedMotion:
    """Judge a motion by limits, speed, torque at a supply, heat and self-collision."""
    monitor.begin("loading")
    world = load_world(request)
    robot, motion = world.robot, find_motion(world.robot, request.motion)
    limit = make_torque_limit(request, robot)
    monitor.begin("rolling out")
    with refusing():
        verdict = judging.preflight(
            world,
            motion,
            voltage=robot.supply_voltage if request.voltage is None else request.voltage,
            torque_limit=limit,
            temperature=request.temperature,
        )
    return JudgedMotion(
        request=request, world=world, motion=motion, verdict=verdict, torque_limit=limit
    )


@preflight.show
def _print(found: JudgedMotion, _: PreflightRequest, console: Console) -> int:
    robot, motion, verdict = found.world.robot, found.motion, found.verdict
    figures = verdict.figures
    word, color = ("passed", "green") if verdict.passed else ("refused", "red")
    console.print(f"[bold {color}]{escape(motion.name)}: {word} at {figures.voltage:.1f} V")
    if not robot.individual.is_as_described:
        console.print(f"robot as identified: {robot.individual}")
    for reason in verdict.reasons:
        mark = "[red]✗[/]" if reason.kind is ReasonKind.REFUSE else "[yellow]![/]"
        console.print(f" {mark} {escape(str(reason))}")
    rises = f"over {MOST_RISES}" if figures.rises_in_a_row is None else f"{figures.rises_in_a_row}"
    ending = f"{'ends' if figures.succeeded else 'does not end'} {describe_end(motion)}"
    if figures.succeeded and motion.rises:
        ending = f"stands after {figures.stand_time:.2f} s"
    console.print(f"rollout: {ending}; rises in a row until a servo is too hot: {rises}")
    table = make_table(HEADINGS, left=["joint"])
    for i in (-figures.torque_use).argsort()[:SHOWN]:
        table.add_row(
            robot.joint_names[i],
            f"{figures.peak_torque[i]:.2f}",
            f"{figures.torque_use[i]:.0%}",
            f"{figures.rms_torque[i]:.2f}",
            f"{figures.saturation[i]:.2f}",
            f"{figures.end_temperature[i]:.1f}",
        )
    console.print(table)
    return DID_IT if verdict.passed else DID_NOT_STAND
