"""`getup play --without-imu`: a motion on a robot that cannot tell how it is turned."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.exit_codes import DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.cli.options.rise import Play
from humanoid_getup.cli.output import REPORT, console_for, staging, to_json, write_json
from humanoid_getup.cli.recording import FLIGHT
from humanoid_getup.cli.session import run_session
from humanoid_getup.execution.blind_play import BlindPlay, play_blind
from humanoid_getup.execution.session import Session
from humanoid_getup.strategies.stored_motion import StoredMotion

NO_PICTURE = "without an IMU no one knows how the robot was turned"


def play_without_imu(command: Play, strategy: StoredMotion) -> int:
    """Play a motion with a robot without an IMU; return the exit code, which claims no stand."""
    robot = strategy.world.robot
    if robot.imu_kind is not None:
        raise BadInputError(
            f"--without-imu is given, but robot '{robot.name}' has an IMU ({robot.imu_kind}): "
            "expected a robot whose robot.toml has neither [imu] nor [bus.board]"
        )

    def prepare(session: Session, _rng: np.random.Generator) -> Callable[[], BlindPlay]:
        return lambda: play_blind(session, strategy.motion)

    def finish(result: BlindPlay, start: str) -> int:
        return _hand_over(result, strategy, command, start)

    return run_session(
        command,
        strategy,
        prepare,
        finish,
        motion=strategy.motion,
        without_imu=True,
        preflight=command.preflight,
    )


def _hand_over(result: BlindPlay, strategy: StoredMotion, command: Play, start: str) -> int:
    """Write and print what is known of the play; return the exit code."""
    robot, motion = strategy.world.robot, strategy.motion
    report: dict[str, Any] = {
        "robot": robot.name,
        "body": str(robot.body),
        "seed": command.seed,
        "start": start,
        "scene": command.scene,
        "backend": command.backend,
        "torque_limit_nm": command.torque_limit,
        "limit_by": strategy.torque_limit.mode,
        "then": command.ending,
        "motion": motion.name,
        "strategy": motion.strategy,
        "period_s": robot.control_period,
        "strip_reason": NO_PICTURE,
        **result.record(),
    }
    if command.out is not None:
        with staging(command.out) as folder:
            Path(folder, REPORT).write_text(to_json(report), "utf-8")
    write_json(to_json(report), command.json)
    _print(result, command)
    return HARDWARE_FAULT if result.by_fault else DID_NOT_STAND


def _print(result: BlindPlay, command: Play) -> None:
    """Print how it ended, in yellow: neither a success nor a failure is known."""
    console = console_for(command.json)
    console.print(f"[bold {'yellow' if result.played else 'red'}]{escape(result.reason)}")
    if result.figures is not None:
        console.print(escape(str(result.figures)))
    if command.out is not None:
        files = [command.out / name for name in (REPORT, FLIGHT) if (command.out / name).exists()]
        console.print(escape(", ".join(map(str, files))))
