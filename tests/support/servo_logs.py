"""Logs of a virtual servo that hides its figures."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from robots.description.servo_catalog import servo_models
from robots.quaternion import Array
from sim2real.identification.pendulums import Pendulums
from sim2real.identification.servo_log import PERIOD, ServoLog

SHEET = servo_models()["XM430-W350"]
HIDDEN = np.array([2.0, 6.0, 0.003, 0.01, 0.06, 0.02, 0.25, 0.06, 0.1, 0.4])
"""Its figures, in the order of `PARAMETERS`."""


def record_servo(figures: Array = HIDDEN, length: float = 1.2) -> list[ServoLog]:
    """Record three trajectories under three gains and loads, with encoder rounding."""
    time = np.arange(0.0, length, PERIOD)
    goals = {
        "chirp": np.sin(4.0 * time**2),
        "waves": np.sin(2.0 * np.pi * time) * np.sin(1.5 * time),
        "up": np.clip(3.0 * time - 0.5, 0.0, 1.4),
    }
    logs = [
        ServoLog(
            name=f"{trajectory} {gain}",
            checksum=f"{trajectory} {gain}",
            servo="xm430-w350",
            period=PERIOD,
            goal=goal,
            joint_pos=np.zeros(len(time)),
            torque_on=np.ones(len(time), dtype=bool),
            start_speed=0.0,
            p_gain=gain,
            voltage=12.0,
            mass=mass,
            arm=0.15,
            trajectory=trajectory,
        )
        for gain, mass in ((100, 1.2), (400, 1.2), (800, 0.6))
        for trajectory, goal in goals.items()
    ]
    step = SHEET.rad_per_tick
    angles = np.round(Pendulums(logs, SHEET).run(figures[None])[0] / step) * step
    return [replace(log, joint_pos=angle) for log, angle in zip(logs, angles, strict=True)]


def write_servo_log(path: Path, log: ServoLog, **changes: object) -> Path:
    """Write a log as a bench does, but for changes; a key that is None is left out."""
    rows = zip(log.goal.tolist(), log.joint_pos.tolist(), strict=True)
    keys = ("timestamp", "goal_position", "position", "torque_enable")
    entries = [
        dict(zip(keys, (PERIOD * k, goal, angle, True), strict=True))
        for k, (goal, angle) in enumerate(rows)
    ]
    file = {
        "mass": log.mass,
        "length": log.arm,
        "kp": log.p_gain,
        "vin": log.voltage,
        "motor": log.servo,
        "trajectory": log.trajectory,
        "entries": entries,
    }
    path.write_text(json.dumps({k: v for k, v in (file | changes).items() if v is not None}))
    return path
