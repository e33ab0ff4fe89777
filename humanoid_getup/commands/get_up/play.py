"""`getup play`: get up once by a stored motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from tyro.conf import Positional

from humanoid_getup.commands.command import command
from humanoid_getup.commands.get_up.operator_key import watch_key
from humanoid_getup.commands.get_up.options import GetUpOptions
from humanoid_getup.commands.get_up.results import FinishedRise, print_rise
from humanoid_getup.commands.get_up.rise_session import run_session
from humanoid_getup.commands.get_up.session_hooks import Operator
from humanoid_getup.commands.inputs import find_motion, load_world, make_torque_limit
from humanoid_getup.commands.options import LoadOption, MotionName
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.strategies.stored_motion import StoredMotion


@dataclass(frozen=True, kw_only=True)
class PlayRequest(LoadOption, GetUpOptions):
    """Play a rising motion and judge how it ends."""

    motion: Positional[MotionName]
    needs_origin: ClassVar[bool] = False
    preflight: bool = True
    """Play only what the preflight passes; --no-preflight requires a simulated robot."""
    without_imu: bool = False
    """Play it with a robot that has no IMU: open loop; whether it stands is unknown. Where it is
    held in the end, a key press switches torque off."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.is_real and not self.preflight:
            yield "--no-preflight requires a simulated robot"
        if self.without_imu and self.then not in (None, "hold", "limp"):
            yield (
                f"--then is {self.then}, expected hold or limp with --without-imu: it is "
                "unknown whether the robot stands"
            )
        if self.without_imu and self.scene != "flat":
            yield f"--scene is {self.scene}, expected flat with --without-imu"


@command("play", json=FinishedRise.describe, person=watch_key, in_lines=True)
def play_motion(
    request: PlayRequest, monitor: ProgressMonitor, *, operator: Operator | None = None
) -> FinishedRise:
    """Rise once by one motion, as `rise` does, with the same errors."""
    monitor.begin("loading")
    world = load_world(request)
    motion = find_motion(world.robot, request.motion)
    strategy = StoredMotion(world, motion, torque_limit=make_torque_limit(request, world.robot))
    if request.without_imu and world.robot.imu_kind is not None:
        raise ValueError(
            f"--without-imu is given, but robot '{world.robot.name}' has an IMU "
            f"({world.robot.imu_kind}): expected a robot whose robot.toml has neither [imu] nor "
            "[bus.board]"
        )
    return run_session(
        request,
        strategy,
        monitor,
        operator,
        motion=motion,
        preflight=request.preflight,
        without_imu=request.without_imu,
    )


play_motion.show(print_rise)
